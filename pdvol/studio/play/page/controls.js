// Time, buttons, keys, labels. `player` is what scripts (and tests) may use.
"use strict";

const swatch = (background) => { const mark = element("i", {}); mark.style.background = background; return mark; };
const SMALL = 190;  // pixels: a pane narrower or lower than this has small labels

class Player {
  constructor(arrays) {
    const panes = DATA.panes, live = panes.filter((pane) => pane.states);
    this.panes = panes;
    this.dt = Math.min(...live.map((pane) => pane.dt));
    this.duration = Math.max(...live.map((pane) => pane.end), this.dt);
    this.steps = Math.ceil(this.duration / this.dt - 1e-6);
    this.view = new View(panes.map((pane) => (pane.states ? new Shown(pane, arrays) : null)));
    this.graphs = new Graphs(panes, this.duration);
    Object.assign(this, { time: 0, playing: false, speed: 1, frames: 0, last: 0, waiting: false });
    this.fill();
    this.listen();
    this.colourBy("");
    this.drawAs("edges");
    this.setLayout(panes.length > 1 ? "grid" : "one");
  }

  // ---- what the page says once
  fill() {
    const live = this.panes.map((pane, i) => [pane, i]).filter(([pane]) => pane.states);
    for (const select of [$("first"), $("second")]) {
      for (const [pane, i] of live) select.append(element("option", { value: i, textContent: pane.title }));
    }
    for (const button of document.querySelectorAll("[data-layout]")) button.hidden = live.length < 2;
    $("colour").parentElement.hidden = $("colour").options.length < 2;
    $("graphs-shown").parentElement.hidden = !this.graphs.charts.length;
    $("scrubber").max = this.steps;
    const names = this.panes.find((pane) => pane.states).names;
    this.bodies = names.map((name, i) => element("span", {}, swatch(DATA.colours.bodies[i % DATA.colours.bodies.length]), name));
    const obstacles = new Map(live.flatMap(([pane]) => pane.obstacles.map(({ name, kind }) => [name, kind === "plane" ? "ground" : "obstacle"])));
    for (const [name, kind] of obstacles) if (name) this.bodies.push(element("span", {}, swatch(DATA.colours[kind]), name));
    const error = Math.max(...live.map(([pane]) => pane.error));
    $("legend").title = [`Positions within ${short(error)} m of the stored ones.`, ...DATA.notes].join(" ");
  }

  // ---- layout
  setLayout(layout, first = this.view.first, second = this.view.second) {
    if (layout === "wipe" && second === first) second = this.panes.findIndex((pane, i) => pane.states && i !== first);
    Object.assign(this.view, { layout, first, second });
    $("first").value = first;
    $("second").value = second;
    for (const button of document.querySelectorAll("[data-layout]")) button.setAttribute("aria-pressed", button.dataset.layout === layout);
    $("pick-first").hidden = layout === "grid" || this.panes.length < 2;
    $("pick-second").hidden = layout !== "wipe";
    $("wipe").hidden = layout !== "wipe";
    this.resize();
  }
  setWipe(share) {
    this.view.wipe = Math.min(Math.max(share, 0), 1);
    $("wipe").style.left = `${100 * this.view.wipe}%`;
    $("wipe").setAttribute("aria-valuenow", Math.round(100 * this.view.wipe));
    this.redraw();
  }
  resize() {
    this.view.resize();
    this.label();
    const { layout, first, second } = this.view;
    this.graphs.draw(layout === "grid" ? this.panes.map((_, i) => i) : layout === "wipe" ? [first, second] : [first]);
    this.graphs.put(this.time);
    this.setWipe(this.view.wipe);
  }
  label() {
    $("labels").replaceChildren();
    for (const [n, place] of this.view.places().entries()) {
      const pane = this.panes[place.pane], frame = element("div", { className: "frame" });
      const right = n === 1 && this.view.layout === "wipe", small = Math.min(place.width, place.height) < SMALL;
      const mark = swatch(colourOfPane(place.pane)), words = [pane.title, ...pane.lines, pane.states ? pane.note : ""].filter(Boolean);
      const label = element("div", { className: `label${small ? " small" : ""}${right ? " right" : ""}`, title: words.join("\n") });
      label.append(element("span", { className: "title" }, pane.states ? mark : "", element("b", { textContent: pane.title })));
      const lines = small ? words.slice(1, 3) : words.slice(1);
      for (const line of lines) label.append(element("span", { textContent: line }));
      if (!pane.states) frame.append(element("p", { textContent: pane.note, title: pane.note }));
      for (const box of [frame, label]) Object.assign(box.style, { left: `${place.x}px`, top: `${place.y}px`, width: `${place.width}px` });
      frame.style.height = `${place.height}px`;
      label.style.maxHeight = `${place.height}px`;
      $("labels").append(frame, label);
    }
  }
  paneAt(event) {
    const box = stage.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    return this.view.places().find((p) => x >= p.x && x < p.x + p.width && y >= p.y && y < p.y + p.height);
  }

  // ---- colours and lines
  colourBy(name) {
    if ($("shape")) $("shape").disabled = Boolean(name);  // fields are those of the simulated surfaces
    SHARED.byField.value = name ? 1 : 0;
    this.view.shown.forEach((shown) => shown && shown.colourBy(name));
    if (name) {
      const { label, unit, top } = DATA.fields[name], ramp = element("i", { className: "ramp" });
      ramp.style.background = `linear-gradient(90deg, ${RAMP.join(", ")})`;
      $("legend").replaceChildren(element("span", {}, `${label}  0`, ramp, `≥ ${short(top)} ${unit}`));
    } else {
      $("legend").replaceChildren(...this.bodies);
    }
    this.redraw();
  }
  shapeAs(shape) {
    this.view.shown.forEach((shown) => shown && shown.shapeAs(shape));
    this.redraw();
  }
  drawAs(how) {
    this.view.shown.forEach((shown) => shown && shown.drawAs(how));
    this.redraw();
  }

  // ---- time
  go(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    $("scrubber").value = this.stepAt(this.time);
    const digits = Math.min(Math.max(Math.ceil(-Math.log10(this.dt)), 0), 6);
    const text = `${this.time.toFixed(digits)} / ${this.duration.toFixed(digits)} s`;
    if ($("clock").textContent !== text) $("clock").textContent = text;
    this.graphs.put(this.time);
    this.redraw();
  }
  stepAt(time) { return time < this.duration - 1e-6 * this.dt ? Math.min(Math.round(time / this.dt), this.steps - 1) : this.steps; }
  stepBy(steps) {
    this.play(false);
    this.go((this.stepAt(this.time) + steps) * this.dt);
  }
  play(playing = !this.playing) {
    if (playing && this.time >= this.duration) this.time = 0;
    this.playing = playing;
    this.last = 0;
    $("play").classList.toggle("playing", playing);
    $("play").setAttribute("aria-label", playing ? "pause" : "play");
    this.redraw();
  }
  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => this.frame(now));
  }
  frame(now) {
    this.waiting = false;
    if (this.playing) {
      let time = this.time + (this.last ? Math.min(now - this.last, 250) / 1000 * this.speed : 0);
      this.last = now;
      if (time > this.duration) {
        if ($("loop").checked) time %= this.duration;
        else this.play(false);
      }
      this.go(time);
    }
    this.view.draw(this.time);
    this.frames++;
  }

  // ---- what the user does
  listen() {
    new ResizeObserver(() => this.resize()).observe(stage);
    this.view.controls.addEventListener("change", () => this.redraw());
    for (const button of document.querySelectorAll("[data-layout]")) button.onclick = () => this.setLayout(button.dataset.layout);
    for (const button of document.querySelectorAll("[data-camera]")) button.onclick = () => { this.view.look(button.dataset.camera); this.redraw(); };
    $("first").onchange = () => this.setLayout(this.view.layout, Number($("first").value));
    $("second").onchange = () => this.setLayout(this.view.layout, this.view.first, Number($("second").value));
    $("colour").onchange = () => this.colourBy($("colour").value);
    if ($("shape")) $("shape").onchange = () => this.shapeAs($("shape").value);
    $("drawn").onchange = () => this.drawAs($("drawn").value);
    $("play").onclick = () => this.play();
    $("speed").onchange = () => { this.speed = Number($("speed").value); };
    $("scrubber").oninput = () => { this.play(false); this.go(Number($("scrubber").value) * this.dt); };
    $("graphs-shown").onchange = () => { $("graphs").hidden = !$("graphs-shown").checked; };
    $("graphs").onpointerdown = (event) => { if (event.target.closest("svg")) $("graphs").setPointerCapture(event.pointerId); this.seek(event); };
    $("graphs").onpointermove = (event) => { if (event.buttons) this.seek(event); };
    $("wipe").onpointerdown = (event) => $("wipe").setPointerCapture(event.pointerId);
    $("wipe").onpointermove = (event) => { if (event.buttons) this.setWipe((event.clientX - stage.getBoundingClientRect().left) / this.view.size[0]); };
    $("wipe").onkeydown = (event) => {
      const move = { ArrowLeft: -0.05, ArrowRight: 0.05 }[event.key];
      if (move) { this.setWipe(this.view.wipe + move); event.stopPropagation(); event.preventDefault(); }
    };
    stage.ondblclick = (event) => {
      const place = this.view.layout === "grid" && this.paneAt(event);
      if (place && this.panes[place.pane].states) this.setLayout("one", place.pane);
      else this.setLayout("grid");
    };
    document.addEventListener("keydown", (event) => this.key(event));
  }
  seek(event) {
    const box = this.graphs.charts[0].querySelector("svg").getBoundingClientRect();
    if (event.type === "pointerdown" && !event.target.closest("svg")) return;
    const share = (event.clientX - box.left - THUMB) / (box.width - 2 * THUMB);
    this.play(false);
    this.go(Math.round(Math.min(Math.max(share, 0), 1) * this.steps) * this.dt);
  }
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input[type=checkbox]")) return;
    if (event.key === " " && event.target.closest("button")) return;
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10, Home: -this.steps, End: this.steps }[event.key];
    const pane = Number(event.key) - 1;
    if (steps) this.stepBy(steps);
    else if (event.key === " ") this.play();
    else if (event.key === "r") this.view.look("reset");
    else if (event.key === "w" && this.panes.filter((one) => one.states).length > 1) this.setLayout("wipe");
    else if (event.key === "g" || event.key === "Escape") { if (this.panes.length > 1) this.setLayout("grid"); }
    else if (pane >= 0 && this.panes[pane] && this.panes[pane].states) this.setLayout("one", pane);
    else return;
    event.preventDefault();
    this.redraw();
  }
}

(async () => {
  try {
    const arrays = await unpacked(DATA.chunks, (number) => {
      const text = $("chunk-" + number).textContent.trim();
      $("chunk-" + number).remove();  // it is not needed any more
      return text;
    });
    window.player = new Player(arrays);
    $("message").hidden = true;
    document.body.dataset.ready = "yes";
    player.go(0);
  } catch (error) {
    $("message").textContent = `The animation cannot be shown: ${error.message}. A browser of 2023 or later with WebGL 2 is needed.`;
    throw error;
  }
})();
