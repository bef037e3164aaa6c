// Makes the figures of a report page interactive with dygraphs. The figures are drawn in the page already: whatever
// fails here leaves them as they are.
(function () {
  "use strict";

  var charts = JSON.parse(document.getElementById("figures").textContent);
  var dashes = [[], [7, 5], [13, 4], [2, 4]];
  var superscripts = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  var drawn = [];

  function colourOf(curve) {
    var name = curve.colour < 0 ? "--ink" : "--s" + curve.colour;
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function ruleColour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  /// dygraphs takes labels of axes as HTML.
  function escaped(text) {
    var holder = document.createElement("p");
    holder.textContent = text;
    return holder.innerHTML;
  }

  function power(exponent) {
    return "10" + String(exponent).replace(/-/g, "⁻").replace(/[0-9]/g, function (d) { return superscripts[+d]; });
  }

  function tickLabel(value) {
    var size = Math.abs(value);
    if (size === 0 || (size >= 1e-3 && size < 1e5)) return String(+value.toPrecision(6));
    var exponent = Math.floor(Math.log10(size) * (1 + 1e-15) + 1e-12);
    var factor = +(value / Math.pow(10, exponent)).toPrecision(4);
    if (factor === 1) return power(exponent);
    return factor === -1 ? "-" + power(exponent) : factor + "·" + power(exponent);
  }

  /// Ticks as in the drawn figures: at multiples of 1, 2 or 5, or at powers of ten.
  function linearTicks(lo, hi, most, whole) {
    var least = (hi - lo) / most;
    var base = Math.pow(10, Math.floor(Math.log10(least)));
    var step = [1, 2, 5, 10].map(function (f) { return f * base; }).find(function (s) { return s >= least * (1 - 1e-9); });
    if (whole) step = Math.max(1, step);
    var ticks = [];
    for (var k = Math.ceil(lo / step - 1e-9); k * step <= hi + 1e-9 * step; ++k) ticks.push(k * step);
    return ticks;
  }

  function logTicks(lo, hi, most) {
    var first = Math.floor(Math.log10(lo) + 1e-12);
    var last = Math.floor(Math.log10(hi) + 1e-12);
    var every = Math.max(1, Math.ceil((last - first + 1) / most));
    function multiples(factors, n) {
      var ticks = [];
      for (var e = first; e <= last; ++e) {
        if (e % n !== 0) continue;
        factors.forEach(function (f) {
          var value = f * Math.pow(10, e);
          if (value >= lo * (1 - 1e-9) && value <= hi * (1 + 1e-9)) ticks.push(value);
        });
      }
      return ticks;
    }
    var ticks = multiples([1], every);
    if (ticks.length < 2) ticks = multiples([1, 2, 5], 1);
    return ticks.length < 2 ? linearTicks(lo, hi, most, false) : ticks;
  }

  function ticker(axis, apart) {
    return function (lo, hi, pixels) {
      var most = Math.max(2, Math.floor(pixels / apart));
      var values = axis.log && lo > 0 ? logTicks(lo, hi, most) : linearTicks(lo, hi, most, axis.whole);
      return values.map(function (v) { return { v: v, label: tickLabel(v) }; });
    };
  }

  function marker(ctx, kind, x, y, colour) {
    ctx.beginPath();
    ctx.fillStyle = colour;
    ctx.strokeStyle = colour;
    ctx.lineWidth = 2;
    if (kind === 0) ctx.arc(x, y, 3.2, 0, 2 * Math.PI);
    if (kind === 1) ctx.rect(x - 3, y - 3, 6, 6);
    if (kind === 2) { ctx.moveTo(x, y - 4.2); ctx.lineTo(x + 3.8, y + 2.4); ctx.lineTo(x - 3.8, y + 2.4); }
    if (kind === 3) { ctx.moveTo(x, y - 4.4); ctx.lineTo(x + 4.4, y); ctx.lineTo(x, y + 4.4); ctx.lineTo(x - 4.4, y); }
    if (kind === 4) { ctx.moveTo(x, y + 4.2); ctx.lineTo(x + 3.8, y - 2.4); ctx.lineTo(x - 3.8, y - 2.4); }
    if (kind === 5) { ctx.moveTo(x - 3, y - 3); ctx.lineTo(x + 3, y + 3); ctx.moveTo(x + 3, y - 3); ctx.lineTo(x - 3, y + 3); }
    if (kind === 6) { ctx.moveTo(x - 4, y); ctx.lineTo(x + 4, y); ctx.moveTo(x, y - 4); ctx.lineTo(x, y + 4); }
    if (kind < 5) ctx.fill(); else ctx.stroke();
  }

  function plotterOf(curve) {
    return function (e) {
      var ctx = e.drawingContext;
      var area = e.plotArea;
      var colour = colourOf(curve);
      var points = e.points.filter(function (p) { return isFinite(p.canvasx) && isFinite(p.canvasy) && p.yval !== null; });
      function place(share) { return area.y + area.h * Math.min(2, Math.max(-1, share)); }
      ctx.save();
      ctx.strokeStyle = colour;
      ctx.fillStyle = colour;
      if (curve.style === "band") {
        ctx.globalAlpha = 0.22;
        ctx.beginPath();
        points.forEach(function (p) { ctx.lineTo(p.canvasx, place(p.y_bottom)); });
        points.slice().reverse().forEach(function (p) { ctx.lineTo(p.canvasx, place(p.y_top)); });
        ctx.fill();
      } else if (curve.style === "line") {
        ctx.lineWidth = 2;
        ctx.setLineDash(dashes[curve.dash] || []);
        ctx.beginPath();
        points.forEach(function (p) { ctx.lineTo(p.canvasx, p.canvasy); });
        ctx.stroke();
      } else {
        ctx.lineWidth = 1.3;
        points.forEach(function (p) {
          if (!(Math.abs(p.y_top - p.y_bottom) > 0)) return;
          ctx.beginPath();
          ctx.moveTo(p.canvasx, place(p.y_top));
          ctx.lineTo(p.canvasx, place(p.y_bottom));
          ctx.stroke();
        });
        points.forEach(function (p) { marker(ctx, curve.marker, p.canvasx, p.canvasy, colour); });
      }
      ctx.restore();
    };
  }

  function shown(value) { return String(+value.toPrecision(4)); }

  /// Value of every curve at its own point next to x: curves may have their points at different places.
  function valuesNear(chart, x) {
    var scaled = chart.x.log ? Math.log : Number;
    var near = 0.04 * (scaled(chart.x.range[1]) - scaled(chart.x.range[0]));
    var parts = [];
    chart.curves.forEach(function (curve, i) {
      if (!curve.label) return;
      var best = null;
      var least = near;
      chart.rows.forEach(function (row) {
        var away = Math.abs(scaled(row[0]) - scaled(x));
        if (!row[i + 1] || !(away < least || (away === least && !best))) return;
        best = row;
        least = away;
      });
      if (!best) return;
      var at = best[0] === x ? "" : " at " + shown(best[0]);
      var bar = best[i + 1];
      var interval = bar[0] === bar[2] ? "" : " (" + shown(bar[0]) + " to " + shown(bar[2]) + ")";
      parts.push(curve.label + at + ": " + shown(bar[1]) + interval);
    });
    return parts;
  }

  function make(chart) {
    var figure = document.getElementById(chart.id);
    if (!figure || chart.rows.length === 0) return;
    var live = document.createElement("div");
    var plot = document.createElement("div");
    var readout = document.createElement("p");
    var all = document.createElement("button");
    live.className = "live";
    plot.className = "plot";
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", figure.querySelector("svg desc").textContent);
    readout.className = "readout";
    all.className = "all";
    all.type = "button";
    all.textContent = "Show all";
    all.hidden = true;
    live.append(plot, all, readout);
    figure.insertBefore(live, figure.querySelector(".scroll"));
    figure.classList.add("interactive");

    var hint = "Drag to zoom; move the pointer over the figure to read values.";
    readout.textContent = hint;
    // Two curves may have one label, but dygraphs takes labels for names.
    var names = chart.curves.map(function (curve, i) { return "curve" + i; });
    var series = {};
    names.forEach(function (name, i) { series[name] = { plotter: plotterOf(chart.curves[i]) }; });
    function near(a, b) { return Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) < 1e-6 * Math.abs(b[1] - b[0]); }
    function showAll() {
      graph.resetZoom();
      graph.updateOptions({ dateWindow: chart.x.range.slice() });
    }
    var graph = new Dygraph(plot, chart.rows, {
      labels: ["x"].concat(names),
      customBars: true,
      connectSeparatedPoints: true,
      logscale: chart.y.log,
      dateWindow: chart.x.range.slice(),
      valueRange: chart.y.range.slice(),
      xlabel: escaped(chart.x.label),
      ylabel: escaped(chart.y.label),
      legend: "never",
      series: series,
      colors: chart.curves.map(colourOf),
      gridLineColor: ruleColour("--grid"),
      axisLineColor: ruleColour("--soft"),
      highlightCircleSize: 5,
      axisLabelFontSize: 13,
      xLabelHeight: 22,
      yLabelWidth: 22,
      rightGap: 14,
      animatedZooms: false,
      axes: {
        x: { logscale: chart.x.log, ticker: ticker(chart.x, 80), axisLabelWidth: 70 },
        y: { ticker: ticker(chart.y, 45), axisLabelWidth: 62 }
      },
      highlightCallback: function (event, x) {
        readout.textContent = chart.x.label + " " + shown(x) + " — " + valuesNear(chart, x).join("; ");
      },
      unhighlightCallback: function () { readout.textContent = hint; },
      interactionModel: Object.assign({}, Dygraph.defaultInteractionModel, { dblclick: showAll }),
      drawCallback: function (g) {
        all.hidden = near(g.xAxisRange(), chart.x.range) && near(g.yAxisRange(), chart.y.range);
      }
    });
    all.addEventListener("click", showAll);
    figure.graph = graph;
    drawn.push({ graph: graph, chart: chart });
  }

  // The page has a legend of its own; that of dygraphs sets style attributes, which the policy of the page refuses.
  Dygraph.PLUGINS = Dygraph.PLUGINS.filter(function (plugin) { return plugin !== Dygraph.Plugins.Legend; });
  charts.forEach(make);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () {
    drawn.forEach(function (one) {
      one.graph.updateOptions({
        colors: one.chart.curves.map(colourOf),
        gridLineColor: ruleColour("--grid"),
        axisLineColor: ruleColour("--soft")
      });
    });
  });
})();
