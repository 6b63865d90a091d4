# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The program behind all commands: how one is registered, how its errors and doubts are told, where saved defaults come in."""

from __future__ import annotations

import functools
import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

import typer
import typer.core

from lugre_steering import defaults
from lugre_steering.errors import ImplausibleWarning, LugreSteeringError
from lugre_steering.version import __version__

# Set before NumPy is imported: its matrices here are so narrow that BLAS threads only fight with our own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

F = TypeVar("F", bound=Callable[..., Any])

PLACEHOLDERS = {Path: "PATH", str: "TEXT", int: "INTEGER", float: "NUMBER"}
"""What stands for a value in a help text."""

OwnEffects = Annotated[
    list[Path] | None, typer.Option("--effects", help="file with physics of your own (.yaml or .py); repeatable")
]

app = typer.Typer(
    help="Steering torque of rubber-tracked vehicles: estimate it, and find the physics that the model leaves out.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,  # it would take the brackets of units for its own
    pretty_exceptions_enable=False,
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        print(f"lugre-steering {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    _: Annotated[bool, typer.Option("--version", help="print the version and leave", callback=_tell_version, is_eager=True)] = False,
) -> None:
    """Steering torque of rubber-tracked vehicles: estimate it, and find the physics that the model leaves out."""
    if context.invoked_subcommand == "config":  # which must work with any content
        return
    try:
        context.default_map = {**defaults.of_commands(defaults.load(), options_of_commands())}
    except LugreSteeringError as error:
        print(f"lugre-steering: {error}", file=sys.stderr)
        raise typer.Exit(2) from None


def options_of_commands() -> dict[str, dict[str, defaults.Option]]:
    """The options of every command by the name as it is typed, without its dashes."""
    found: dict[str, dict[str, defaults.Option]] = {}
    for registered in app.registered_commands:
        function = registered.callback
        assert function is not None
        name = registered.name or function.__name__
        for parameter in inspect.signature(function, eval_str=True).parameters.values():
            hint, *info = get_args(parameter.annotation) or (None,)
            if info and isinstance(info[0], typer.models.OptionInfo):
                # Typer holds the first name where other uses have a default.
                names = [text for text in (info[0].default, *(info[0].param_decls or ())) if str(text).startswith("--")]
                typed = str(names[0])[2:] if names else parameter.name.replace("_", "-")
                found.setdefault(name, {})[typed] = defaults.Option(parameter.name, hint)
    return found


def _name_values(signature: inspect.Signature) -> None:
    """In the help of a command the value of an option is called what it is to people: Typer's releases differ in it ('<list[Path]>')."""
    for parameter in signature.parameters.values():
        hint, *info = get_args(parameter.annotation) or (None,)
        named = [PLACEHOLDERS[kind] for one in (hint, *get_args(hint)) for kind in (one, *get_args(one)) if kind in PLACEHOLDERS]
        if named and info and isinstance(info[0], typer.models.OptionInfo) and info[0].metavar is None:
            info[0].metavar = named[0]


def argument_name(parameter: Any) -> str:
    """What an argument (not an option) of a command is called in help and guide: 'BAGS...'."""
    return f"{(parameter.metavar or parameter.name).upper()}{'...' if parameter.nargs != 1 else ''}"


class _Command(typer.core.TyperCommand):
    """Its help calls arguments what they are to people: Typer's releases differ in it ('{bags}...', '<list[Path]>')."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        arguments = [each for each in self.get_params(ctx) if each.param_type_name == "argument"]
        return ["[OPTIONS]", *(argument_name(each) if each.required else f"[{argument_name(each)}]" for each in arguments)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        for title, kind in (("Arguments", "argument"), ("Options", "option")):
            shown = [(each, each.get_help_record(ctx)) for each in self.get_params(ctx) if each.param_type_name == kind]
            rows = [(argument_name(each) if kind == "argument" else record[0], record[1]) for each, record in shown if record]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


@contextmanager
def doubts_told_once() -> Iterator[None]:
    """Doubts about a vehicle file as one line each on stderr, however often it is read; other warnings as ever."""
    with warnings.catch_warnings():
        warnings.simplefilter("once", ImplausibleWarning)
        show = warnings.showwarning

        def tell(message: Warning | str, category: type[Warning], *place: Any, **options: Any) -> None:
            if issubclass(category, ImplausibleWarning):
                print(f"lugre-steering: warning: {message}", file=sys.stderr)
            else:
                show(message, category, *place, **options)

        warnings.showwarning = tell
        yield


def command(name: str | None = None) -> Callable[[F], F]:
    """Register a command whose expected errors end as one line on stderr and exit code 2."""

    def register(function: F) -> F:
        @functools.wraps(function)
        def run(*arguments: Any, own_effects: list[Path] | None = None, **options: Any) -> Any:
            try:
                if own_effects:
                    from lugre_steering.effects.registry import add_files

                    add_files(own_effects)
                with doubts_told_once():
                    return function(*arguments, **options)
            except LugreSteeringError as error:
                print(f"lugre-steering: {error}", file=sys.stderr)
                raise typer.Exit(2) from None
            except BrokenPipeError:  # whoever read our output has left
                raise
            except OSError as error:
                print(f"lugre-steering: {error.filename or name or function.__name__}: {error.strerror or error}", file=sys.stderr)
                raise typer.Exit(2) from None

        own = inspect.signature(function, eval_str=True)
        last = inspect.Parameter("own_effects", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=OwnEffects)
        whole = own.replace(parameters=[*own.parameters.values(), last])
        _name_values(whole)
        run.__signature__ = whole  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in run.__signature__.parameters.values()}  # type: ignore[attr-defined]
        app.command(name, cls=_Command)(run)
        return function

    return register
