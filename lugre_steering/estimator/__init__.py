# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The estimator: timestamped samples in, torque, temperature and residual out.

Live node and replay push the same messages through the same compiled loop, so equal inputs give equal numbers.

Rules of time (header stamps only, never arrival times):

* Each angle sample advances its own side exactly once. A torque is published when both sides have a sample of the same
  stamp, to within half a sampling period; samples wait for a partner that arrives late, and one that gets none is
  counted as unpaired (it has advanced its side all the same).
* The residual of a torque follows when every line has a pressure at or after its stamp; pressures are interpolated
  linearly, never held or extrapolated, and not across a gap.
* Duplicate, backward, zero, not finite, absurd and jumping samples are rejected and counted by reason. A jump is
  believed when the next sample of the same channel confirms it and, for an angle, the other side is there or jumps as
  well. At a jump of both sides back in time the estimator begins again with the heat and memories that it has, its bristles
  not known; a side or line that jumps back alone loses its own samples in waiting, nothing else. A torque that is no finite
  number starts it anew, without any past; ``restart`` counts both.
* A confirmed jump of an angle moves the angle of the model, not its contact: it is never slip and never heat (``doubt``).
* The feed-forward keeps to limits of value and rate, and goes to zero over a ramp while anything speaks against it
  (``doubts`` of the estimate says what): a jump, a frozen or noisy angle, a residual that is not plausible, a plan that is
  not, a command that is none, a temperature or motion outside what the model knows (``release``).
* After motion that nobody saw the torque is in doubt until every state that it can have left leads to the same (``unseen``).
* A rate that is no number counts as not given; so does one that the angles contradict, which is counted (``absurd_rate``).
"""

from lugre_steering.estimator.estimator import PLAN_POINTS, WAITING_RING, Estimator, Options, doubts

__all__ = ["PLAN_POINTS", "WAITING_RING", "Estimator", "Options", "doubts"]
