// Copyright 2026 The lugre_steering contributors. SPDX-License-Identifier: Apache-2.0
// Draws the charts of a page: panels one below the other over one x axis, as SVG whose colours are those of the page's style.
(function () {
  "use strict";
  var LEFT = 64, RIGHT = 12, TOP = 22, GAP = 30, BOTTOM = 40, LANE = 7;

  function svg(name, attributes, parent, text) {
    var node = document.createElementNS("http://www.w3.org/2000/svg", name);
    Object.keys(attributes).forEach(function (key) { node.setAttribute(key, attributes[key]); });
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  }
  function element(name, parent, text, attributes) {
    var node = document.createElement(name);
    if (text) node.textContent = text;
    Object.keys(attributes || {}).forEach(function (key) { node.setAttribute(key, attributes[key]); });
    parent.appendChild(node);
    return node;
  }
  function xAt(series, i) { return series.x ? series.x[i] : series.x0 + i * series.dx; }
  function ticks(low, high, most) {
    var raw = (high - low) / Math.max(most, 1), power = Math.pow(10, Math.floor(Math.log10(raw)));
    var step = [1, 2, 2.5, 5, 10].map(function (n) { return n * power; }).find(function (n) { return n >= raw * (1 - 1e-9); });
    var found = [], first = Math.ceil(low / step - 1e-9), decimals = Math.min(9, (step.toFixed(9).replace(/0+$/, "").split(".")[1] || "").length);
    for (var k = first; k * step <= high + 1e-9 * step; k++) found.push([k * step, (k * step).toFixed(decimals).replace("-", "\u2212").replace(/^\u2212(0(\.0*)?)$/, "$1")]);
    return found;
  }
  // Days since an instant [ms] as dates, with hours only where a day is wide enough.
  function dates(low, high, most, since) {
    var step = [1 / 24, 1 / 8, 1 / 4, 1 / 2, 1, 2, 7, 14, 30, 90, 180, 365, 730, 1825].find(function (n) { return n >= (high - low) / Math.max(most, 1); }) || 3650;
    var found = [];
    for (var k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      var said = new Date(since + Math.round(k * step * 24) * 3600000).toISOString();
      found.push([k * step, step < 1 ? said.slice(5, 16).replace("T", " ") : said.slice(0, 10)]);
    }
    return found;
  }
  function digits(value) { return value === null || value === undefined ? "-" : String(Number(value.toPrecision(4))).replace("-", "\u2212"); }

  function Chart(figure, spec) {
    var self = this, names = {};
    this.figure = figure; this.spec = spec; this.hidden = {};
    this.whole = spec.range; this.shown = spec.range.slice();
    var legend = element("div", figure, "", { "class": "legend" });
    spec.panels.forEach(function (panel) { panel.series.forEach(function (series) { if (series.name && !names[series.name]) names[series.name] = series; }); });
    spec.spans.forEach(function (span) { if (!names[span.name]) names[span.name] = { kind: "area", style: span.style }; });
    Object.keys(names).forEach(function (name) {
      var button = element("button", legend, "", { type: "button", "aria-pressed": "true" });
      var key = svg("svg", { viewBox: "0 0 26 10", "aria-hidden": "true" }, button), kind = names[name].kind;
      if (kind === "line") svg("path", { d: "M0,5H26", "class": "curve s-" + names[name].style }, key);
      else if (kind === "dots") svg("path", { d: "M5,5h0M13,5h0M21,5h0", "class": "dots s-" + names[name].style }, key);
      else svg("rect", { x: 3, y: 0, width: 20, height: 10, "class": "lane s-" + names[name].style }, key);
      button.appendChild(document.createTextNode(name));
      button.addEventListener("click", function () {
        self.hidden[name] = !self.hidden[name]; button.setAttribute("aria-pressed", String(!self.hidden[name])); self.draw();
      });
    });
    var tools = element("span", legend, "", { "class": "tools" });
    [["+", "Zoom in", 0.5], ["\u2212", "Zoom out", 2], ["\u27f2", "Show everything", 0]].forEach(function (tool) {
      element("button", tools, tool[0], { type: "button", "aria-label": tool[1], title: tool[1] }).addEventListener("click", function () { self.zoom(tool[2]); });
    });
    this.canvas = element("div", figure, "", { tabindex: "0", role: "img", "aria-label": figure.getAttribute("data-words") + ". Keys: plus and minus zoom, arrows move, Home shows everything." });
    this.readout = element("div", figure, "", { "class": "readout" });
    this.canvas.addEventListener("keydown", function (event) {
      var act = { "+": [0.5, 0], "=": [0.5, 0], "-": [2, 0], Home: [0, 0], Escape: [0, 0], ArrowLeft: [1, -0.25], ArrowRight: [1, 0.25] }[event.key];
      if (act && !event.ctrlKey && !event.metaKey && !event.altKey) { event.preventDefault(); self.zoom(act[0], act[1]); }
    });
    this.draw();
    new ResizeObserver(function () { if (figure.clientWidth !== self.width && figure.clientWidth > 0) self.draw(); }).observe(figure);
  }

  Chart.prototype.zoom = function (factor, shift) {
    var a = this.shown[0], b = this.shown[1], half = 0.5 * (b - a) * factor, middle = 0.5 * (a + b) + (shift || 0) * (b - a);
    this.show(factor === 0 ? this.whole.slice() : [middle - half, middle + half]);
  };
  Chart.prototype.show = function (range) {
    var size = Math.min(range[1] - range[0], this.whole[1] - this.whole[0]), low = Math.max(this.whole[0], Math.min(range[0], this.whole[1] - size));
    if (size > 1e-6 * (this.whole[1] - this.whole[0])) { this.shown = [low, low + size]; this.draw(); }
  };

  // The smallest and the largest value within each pixel column, so that no peak is lost.
  Chart.prototype.path = function (series, toX, toY) {
    var n = series.y.length, text = [], column = null, lo, hi, first, last, pen = false, from = 0, to = n - 1, shown = this.shown;
    if (!series.x) { from = Math.max(0, Math.floor((shown[0] - series.x0) / series.dx) - 1); to = Math.min(n - 1, Math.ceil((shown[1] - series.x0) / series.dx) + 1); }
    function flush() {
      if (column === null) return;
      [first, lo, hi, last].forEach(function (y, i) { if (i === 0 || y !== first || i === 3) { text.push((pen ? "L" : "M") + column + "," + toY(y).toFixed(1)); pen = true; } });
      column = null;
    }
    for (var i = from; i <= to; i++) {
      var x = xAt(series, i), y = series.y[i];
      if (y === null || x === null) { flush(); pen = false; continue; }
      if (series.x) { flush(); pen = pen && text.length > 0; text.push((pen ? "L" : "M") + toX(x).toFixed(1) + "," + toY(y).toFixed(1)); pen = true; continue; }
      var at = Math.round(toX(x) * 2) / 2;
      if (at !== column) { flush(); column = at; first = lo = hi = last = y; } else { lo = Math.min(lo, y); hi = Math.max(hi, y); last = y; }
    }
    flush();
    return text.join("");
  };

  Chart.prototype.draw = function () {
    var self = this, spec = this.spec, width = this.width = Math.max(this.figure.clientWidth, 260), narrow = width < 560;
    var left = narrow ? 48 : LEFT, right = width - RIGHT, lanes = spec.spans.length * LANE, y = TOP + lanes, unit = narrow ? 62 : 88;
    var a = this.shown[0], b = this.shown[1], toX = function (x) { return left + (right - left) * (x - a) / (b - a || 1); };
    var heights = spec.panels.map(function (panel) { return unit * panel.size; });
    var total = y + heights.reduce(function (sum, h) { return sum + h + GAP; }, 0) - GAP + BOTTOM;
    var root = svg("svg", { viewBox: "0 0 " + width + " " + total, "class": "chart" });
    var id = "clip-" + this.figure.id, clip = svg("clipPath", { id: id }, svg("defs", {}, root));
    svg("rect", { x: left, y: 0, width: right - left, height: total }, clip);
    this.panels = []; this.left = left; this.right = right;
    spec.spans.forEach(function (span, lane) {
      if (self.hidden[span.name]) return;
      span.at.forEach(function (s) { svg("rect", { x: toX(s[0]).toFixed(1), width: Math.max(toX(s[1]) - toX(s[0]), 0.8).toFixed(1), y: 2 + lane * LANE, height: LANE - 2, "class": "lane s-" + span.style, "clip-path": "url(#" + id + ")" }, root); });
    });
    spec.panels.forEach(function (panel, p) {
      var top = y, h = heights[p], low = Infinity, high = -Infinity, visible = panel.series.filter(function (s) { return !self.hidden[s.name]; });
      visible.forEach(function (series) {
        for (var i = 0; i < series.y.length; i++) {
          var x = xAt(series, i); if (x === null || x < a || x > b) continue;
          [series.y[i], series.low && series.low[i], series.kind === "area" ? series.y[i] : null].forEach(function (v) { if (v !== null && v !== undefined) { low = Math.min(low, v); high = Math.max(high, v); } });
        }
      });
      if (panel.like !== undefined && self.panels[panel.like]) { low = self.panels[panel.like].low; high = self.panels[panel.like].high; }
      else { if (!(low <= high)) { low = 0; high = 1; } var pad = 0.05 * (high - low) || Math.abs(high) * 0.1 || 1; low -= pad; high += pad; }
      var toY = function (v) { return top + h - h * (v - low) / (high - low); };
      ticks(low, high, Math.max(3, h / 40)).forEach(function (tick) {
        svg("path", { d: "M" + left + "," + toY(tick[0]).toFixed(1) + "H" + right, "class": "grid" }, root);
        svg("text", { x: left - 6, y: (toY(tick[0]) + 4).toFixed(1), "text-anchor": "end" }, root, tick[1]);
      });
      (spec.since === undefined ? ticks(a, b, Math.max(4, (right - left) / 90)) : dates(a, b, Math.max(2, (right - left) / 100), spec.since)).forEach(function (tick) {
        svg("path", { d: "M" + toX(tick[0]).toFixed(1) + "," + top + "V" + (top + h), "class": "grid" }, root);
        if (p === spec.panels.length - 1) svg("text", { x: toX(tick[0]).toFixed(1), y: top + h + 16, "text-anchor": "middle" }, root, tick[1]);
      });
      svg("path", { d: "M" + left + "," + top + "V" + (top + h) + "H" + right, "class": "axis", fill: "none" }, root);
      svg("text", { x: narrow ? 2 : left, y: top - 7, "class": "name" }, root, panel.label);
      var inner = svg("g", { "clip-path": "url(#" + id + ")" }, root);
      spec.spans.forEach(function (span) {
        if (span.shade && !self.hidden[span.name]) span.at.forEach(function (s) { svg("rect", { x: toX(s[0]).toFixed(1), width: Math.max(toX(s[1]) - toX(s[0]), 0.5).toFixed(1), y: top, height: h, "class": "span s-" + span.style }, inner); });
      });
      if (panel.band) svg("rect", { x: left, width: right - left, y: toY(Math.min(panel.band, high)), height: toY(Math.max(-panel.band, low)) - toY(Math.min(panel.band, high)), "class": "span s-held" }, inner);
      visible.forEach(function (series) {
        var d = "", i;
        if (series.kind === "dots") { for (i = 0; i < series.y.length; i++) if (series.y[i] !== null) d += "M" + toX(xAt(series, i)).toFixed(1) + "," + toY(series.y[i]).toFixed(1) + "h0"; svg("path", { d: d, "class": "dots s-" + series.style }, inner); }
        else if (series.kind === "area") {
          for (i = 0; i < series.y.length; i++) d += (i ? "L" : "M") + toX(xAt(series, i)).toFixed(1) + "," + toY(series.y[i]).toFixed(1);
          for (i = series.y.length - 1; i >= 0; i--) d += "L" + toX(xAt(series, i)).toFixed(1) + "," + toY(series.low[i]).toFixed(1);
          svg("path", { d: d + "Z", "class": "area s-" + series.style }, inner);
        } else svg("path", { d: self.path(series, toX, toY), "class": "curve s-" + series.style }, inner);
      });
      self.panels.push({ top: top, low: low, high: high });
      y += h + GAP;
    });
    svg("text", { x: (left + right) / 2, y: total - 6, "text-anchor": "middle", "class": "name" }, root, spec.label);
    this.canvas.replaceChildren(root);
    this.listen(root, total);
  };

  Chart.prototype.listen = function (root, total) {
    var self = this, begin = null, line = svg("path", { "class": "cursor", fill: "none" }, root), pick = svg("rect", { "class": "pick", y: 0, height: total, width: 0 }, root);
    function value(event) {
      var box = root.getBoundingClientRect(), px = Math.min(Math.max((event.clientX - box.left) * self.width / box.width, self.left), self.right);
      return { px: px, x: self.shown[0] + (self.shown[1] - self.shown[0]) * (px - self.left) / (self.right - self.left) };
    }
    root.addEventListener("pointerdown", function (event) { if (event.button === 0) { begin = value(event); root.setPointerCapture(event.pointerId); } });
    root.addEventListener("pointermove", function (event) {
      var now = value(event), words = [];
      line.setAttribute("d", "M" + now.px.toFixed(1) + ",0V" + (total - BOTTOM));
      if (begin) { pick.setAttribute("x", Math.min(begin.px, now.px)); pick.setAttribute("width", Math.abs(begin.px - now.px)); }
      self.spec.panels.forEach(function (panel) {
        var said = [];
        panel.series.forEach(function (series) {
          if (series.kind !== "line" || series.x || self.hidden[series.name]) return;
          var i = Math.round((now.x - series.x0) / series.dx);
          if (i >= 0 && i < series.y.length && series.y[i] !== null) said.push(series.name + " " + digits(series.y[i]));
        });
        if (said.length) words.push(panel.label + " " + said.join(", "));
      });
      if (words.length) self.readout.textContent = digits(now.x) + " s: " + words.join("; ");
    });
    function end(event) {
      if (begin && event.type === "pointerup") { var now = value(event); if (Math.abs(now.px - begin.px) > 8) { var from = begin.x; begin = null; self.show([Math.min(from, now.x), Math.max(from, now.x)]); return; } }
      begin = null; pick.setAttribute("width", 0);
    }
    root.addEventListener("pointerup", end); root.addEventListener("pointercancel", end);
    root.addEventListener("pointerleave", function () { line.removeAttribute("d"); self.readout.textContent = ""; });
    root.addEventListener("dblclick", function () { self.zoom(0); });
  };

  var specs = JSON.parse(document.getElementById("charts").textContent);
  Object.keys(specs).forEach(function (id) { new Chart(document.getElementById(id), specs[id]); });

  var closed = [];  // what is folded on a screen is on paper too
  window.addEventListener("beforeprint", function () {
    closed = Array.from(document.querySelectorAll("details:not([open])"));
    closed.forEach(function (details) { details.open = true; });
  });
  window.addEventListener("afterprint", function () { closed.forEach(function (details) { details.open = false; }); });
})();
