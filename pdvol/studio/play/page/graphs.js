// Curves over time, under the time line: one line a pane.
"use strict";

const THUMB = 8;  // pixels: half of the scrubber's thumb, which stays within its track
const SVG = "http://www.w3.org/2000/svg";
const colourOfPane = (pane) => DATA.colours.bodies[(pane + 1) % DATA.colours.bodies.length];

function short(value) {
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(3)));
}

class Graphs {
  constructor(panes, duration) {
    Object.assign(this, { panes, duration, holder: document.getElementById("graphs"), playhead: document.getElementById("playhead") });
    this.charts = [...this.holder.querySelectorAll(".graph")].filter((chart) => this.offered(chart));
    this.charts.forEach((chart) => chart.querySelector("select").addEventListener("change", () => this.draw(this.chosen)));
  }
  // Keeps the curves that a pane has; a graph without any is removed.
  offered(chart) {
    const select = chart.querySelector("select");
    for (const option of [...select.options]) {
      if (!this.panes.some((pane) => pane.states && pane.curves[option.value])) option.remove();
    }
    if (!select.options.length) chart.remove();
    return select.options.length > 0;
  }
  get shown() { return !this.holder.hidden && this.charts.length > 0; }

  draw(chosen) {  // `chosen`: the panes whose lines are drawn full
    this.chosen = chosen;
    for (const chart of this.charts) this.drawChart(chart, chart.querySelector("select").value);
  }
  drawChart(chart, name) {
    const svg = chart.querySelector("svg"), width = svg.clientWidth, height = svg.clientHeight;
    const curves = this.panes.map((pane) => (pane.states && pane.curves[name]) || []);
    const values = curves.flat().filter((value) => value !== null);
    let low = Math.min(...values), high = Math.max(...values);
    if (name in { centre: 1, turn: 1 }) low = 0;
    chart.querySelector(".top").textContent = short(high) + " " + DATA.units[name];
    chart.querySelector(".bottom").textContent = short(low) + " " + DATA.units[name];
    if (!(high > low)) [low, high] = [low - 1, high + 1];
    const x = (time) => THUMB + (width - 2 * THUMB) * time / this.duration;
    const y = (value) => 4 + (height - 8) * (high - value) / (high - low);
    svg.replaceChildren();
    const order = curves.map((_, pane) => pane).sort((a, b) => this.chosen.includes(a) - this.chosen.includes(b));
    for (const pane of order) {
      for (const part of unbroken(curves[pane])) {
        const line = document.createElementNS(SVG, "polyline");
        line.setAttribute("points", part.map(([state, value]) => `${x(Math.min(state * this.panes[pane].dt, this.panes[pane].end)).toFixed(1)},${y(value).toFixed(1)}`).join(" "));
        line.setAttribute("stroke", colourOfPane(pane));
        line.setAttribute("opacity", this.chosen.includes(pane) ? 1 : 0.22);
        svg.append(line);
      }
    }
  }
  put(time) {
    if (!this.shown) return;
    const svg = this.charts[0].querySelector("svg"), left = svg.getBoundingClientRect().left - this.holder.getBoundingClientRect().left;
    this.playhead.style.transform = `translateX(${left + THUMB + (svg.clientWidth - 2 * THUMB) * time / this.duration}px)`;
  }
}

// Runs of known values, as [state, value]; a value alone is drawn as a short line.
function unbroken(values) {
  const parts = [];
  let part = [];
  values.forEach((value, state) => {
    if (value !== null) part.push([state, value]);
    if ((value === null || state === values.length - 1) && part.length) {
      parts.push(part);
      part = [];
    }
  });
  return parts;
}
