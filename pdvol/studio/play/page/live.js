// The live page: a run whose states come over a websocket as they are asked for. `live` is what scripts (and tests) may use.
"use strict";

const AHEAD = 8;  // steps that are asked for before they are played
const TEXTS = 150;  // ms between changes of the page's words while a hand plays: each costs as much as a picture
const CHECKED = 16;  // pictures of a take from one whose time is taken to the next
const SLOW = 8;  // ms of a picture from which on a take is drawn with fewer pixels, and not at each chance
const SLOW_WAIT = 30;  // ms between such pictures; half as much again where simulated time is slower than the clock
const RESTS = 300;  // ms without a new picture after which one without a graphics card gets smooth edges
const MOST_BYTES = 4e8;  // of places of a level in the page; beyond it they are asked for anew

// Whether the processor draws. Smooth edges then cost as much as all else of a picture.
const SOFTWARE = (() => {
  const gl = document.createElement("canvas").getContext("webgl2"), names = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return Boolean(names) && /swiftshader|llvmpipe|softpipe|software|basic render/i.test(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
})();

// Positions of one part, of the steps that have come. Neighbours stand in for others.
class ComingStates {
  constructor(first) { Object.assign(this, { points: first.points, states: Infinity, held: new Map([[0, first.at(0)]]) }); }
  at(step) { return this.held.get(step) || this.held.get(step - 1) || this.held.get(0); }
}

class LiveShown extends Shown {
  constructor(pane, arrays) {
    const following = (part) => {
      const states = new ComingStates(arrays[part.positions]);
      part.positions = arrays.push(states) - 1;
      return states;
    };
    const parts = [[following(pane), pane]];
    for (const part of pane.obstacles.filter((obstacle) => obstacle.moving)) parts.push([part.kind === "plane" ? null : following(part), part]);
    for (const part of [pane, ...pane.obstacles]) Object.assign(part, { low: [0, 0, 0], span: [1, 1, 1] });
    super(pane, arrays);
    Object.assign(this, { coming: parts, at: 0, samples: new Map() });
  }
  get held() { return this.coming[0][0].held; }
  add(step, rows) {
    if (this.held.size * rows.byteLength > MOST_BYTES) this.forget();
    let from = 0;
    for (const [states, part] of this.coming) {
      const values = rows.subarray(from, from += 4 * (states ? states.points : 2)), dim = FLAT ? 2 : 3;
      if (states) states.held.set(step, values);
      else part.places[step] = [...values.subarray(0, dim), ...values.subarray(4, 4 + dim)];
    }
    for (const moving of this.moving) if (moving.state === step - 1) moving.state = -1;
  }
  forget() { for (const [states] of this.coming) if (states) states.held = new Map([[0, states.held.get(0)]]); }
  positionAt() { return this.at; }
  // What a hand can meet, as it is shown: triangles, and of bodies also their places at rest.
  touchable() {
    const { pane, arrays } = this, rowsOf = ({ positions }) => arrays[positions].at(Math.min(Math.floor(this.at), arrays[positions].states - 1));
    const [faces, bodies, rest] = [pane.faces, pane.bodies, pane.rest].map((number) => arrays[number].values);
    const supported = new Map(pane.supports.flatMap(({ name, vertices }) => vertices.map((vertex) => [vertex, name])));
    const parts = [{ rows: rowsOf(pane), faces, bodies, rest, names: pane.names, supported }];
    for (const one of pane.obstacles) {
      if (one.kind === "plane" || (one.opacity < 1 && !one.movable)) continue;
      parts.push({ rows: rowsOf(one), faces: one.triangles || arrays[one.faces].values, name: one.name, movable: one.movable });
    }
    return parts;
  }
  dispose() {
    this.scene.traverse((object) => { if (object.geometry) { object.geometry.dispose(); object.material.dispose(); } });
  }
}

class Live {
  constructor() {
    Object.assign(this, { status: {}, run: 0, levels: new Map(), asked: new Set(), view: null, waiting: false, spoke: 0, drew: 0 });
    Object.assign(this, { position: 0, follows: true, plays: false, last: 0, frames: 0 });
    this.rows = DATA.controls.map((control) => this.field(control));
    this.hand = new Hand(this);
    this.listen();
    this.socket = new WebSocket(`ws://${location.host}/socket`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => (typeof data === "string" ? this.hear(JSON.parse(data)) : this.receive(data));
    this.socket.onclose = () => this.say("The server has ended.");
  }
  ask(what, more = {}) { if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ do: what, ...more })); }
  say(text) { $("mistake").textContent = text; }

  // ---- what comes
  hear(message) {
    if (message.message) this.say(message.message);
    if (message.status) this.follow(message.status);
    if (message.done === "scene") this.build(message);
    if (message.done === "fit") { useCamera(message.camera); this.view.look("reset"); this.redraw(); }
    if (message.done === "keep") $("name").value = nextName($("name").value);
  }
  follow(status) {
    const ended = this.status.playing && !status.playing;
    Object.assign(this, { status, news: true });
    if (ended) Object.assign(this, { follows: false, plays: false, position: this.newest, stale: true });  // a take's end stays
    if (status.run && status.run !== this.run) {
      for (const [level, shown] of this.levels) if (shown && shown !== this.shown) shown.dispose();
      Object.assign(this, { run: status.run, levels: new Map(), follows: true, plays: false, position: status.begin });
      this.asked.clear();
    }
    if (status.offsets) this.asked.add(`0 ${this.newest}`);  // it comes at once
    if (status.run && this.follows) this.newestHeld();  // it is asked for before the next frame
    this.redraw(false);
  }
  write() {  // what the status says
    const { lines, paused, playing, mine, free, values, takes, run, states } = this.status;
    this.news = false;
    $("lines").replaceChildren(...lines.map(([className, textContent]) => element("p", { className, textContent })));
    $("pause").textContent = paused ? "Go on computing" : "Pause computing";
    $("pause").disabled = playing;
    $("hand").textContent = playing ? "End the take" : "Play by hand";
    $("hand").disabled = playing && !mine && !free;
    $("hint").textContent = !playing ? "" : mine || free ? "press on a body and drag it; Shift or the wheel for depth" : "another page has the hand";
    for (const row of this.rows) if (!row.contains(document.activeElement)) row.show(values[row.name]);
    if (run) for (const input of [$("scrubber"), $("step")]) input.max = playing ? states[0] - 1 : this.status.steps;
    const listed = JSON.stringify([takes, run]);
    if (listed !== this.listed) $("takes").replaceChildren(...takes.map((take) => this.take(take)));
    this.listed = listed;
    $("taken").hidden = !takes.length;
  }
  take({ number, name, words }) {
    const ask = (what) => () => { this.say(""); this.ask(what, { number }); };
    const shows = element("button", { type: "button", textContent: name, title: "show it", onclick: ask("show") });
    shows.setAttribute("aria-pressed", number === this.status.run);
    return element("p", { className: "row" }, shows, element("span", { textContent: words }), element("span", { className: "space" }),
      element("button", { type: "button", textContent: "Refine", title: `compute the finer levels of ${name}`, onclick: ask("refine") }));
  }
  async build({ run, level, pane, chunks, texts, camera }) {
    const arrays = await unpacked(chunks, (number) => texts[number]);
    if (run !== this.run) return;
    if (!this.view) useCamera(camera);
    const shown = new LiveShown(pane, arrays);
    shown.drawAs($("drawn").value);
    this.levels.set(level, shown);
    if (!this.view) {
      this.view = new View([shown], !SOFTWARE);
      this.view.controls.addEventListener("change", () => this.redraw());
      new ResizeObserver(() => { this.view.resize(); this.redraw(); }).observe(stage);
      $("message").hidden = true;
    }
    this.redraw();
  }
  receive(data) {
    const [run, level, step, sample] = new Int32Array(data, 0, 4), shown = this.levels.get(level);
    this.asked.delete(`${level} ${step}`);
    if (run !== this.run || !shown) return;
    shown.add(step, new Float32Array(data, 16));
    if (sample) shown.samples.set(step, sample);
    this.redraw(false);
  }

  // ---- the moment
  get newest() { return this.status.run ? Math.max(this.status.states[0] - 1, 0) : 0; }
  levelAt(step) {  // the finest one that has the step, or the chosen one
    const without = this.status.states.findIndex((states) => states <= step), wanted = $("level").value;
    const finest = (without < 0 ? this.status.states.length : without) - 1;
    return Math.max(0, wanted === "" ? finest : Math.min(finest, Number(wanted)));
  }
  newestHeld() {  // of the level that is followed: later ones are on their way
    const level = this.levelAt(this.newest), shown = this.levels.get(level);
    let step = this.newest;
    if (shown) this.want(shown, level, step, step);
    while (shown && step > this.status.begin && !shown.held.has(step)) step--;
    return step;
  }
  choose(step, follows = false) {
    Object.assign(this, { position: Math.min(Math.max(step, 0), this.newest), follows, plays: false });
    this.redraw();
  }
  step() { return Math.floor(Math.min(this.position, this.newest) + 1e-9); }
  forward() {
    if (this.step() + 1 > this.newest) this.ask("go_to", { step: this.newest + 1 });
    this.choose(this.step() + 1);
    this.follows = this.status.paused && this.step() === this.newest;
  }
  play() {
    if (this.plays || this.follows) return this.choose(this.step());
    Object.assign(this, { plays: true, last: 0, position: this.step() >= this.newest ? 0 : this.position });
    this.redraw();
  }
  advance(now) {
    const passed = this.last ? (now - this.last) / 1000 / this.status.dt : 0;
    this.last = now;
    if (this.follows) {
      this.position = this.newestHeld();
      if (this.status.ended && !this.status.playing) Object.assign(this, { follows: false, plays: true });
    } else if (this.plays && this.newest > 0) {
      this.position += passed;
      if (!this.status.ended) this.position = Math.min(this.position, this.newest);
      else if (this.position > this.newest + 1) this.position = 0;  // the last one is seen for a step's time
    }
  }

  // ---- drawing
  redraw(stale = true) {
    this.stale = this.stale || stale;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => this.frame(now));
  }
  frame(now) {
    this.waiting = false;
    const { playing, factor } = this.status, speaks = !playing || now > this.spoke + TEXTS;
    if (speaks) this.spoke = now;
    if (this.news && speaks) this.write();
    if (!this.status.run) return;
    if (playing && this.view && this.view.quality < 1 && now < this.drew + SLOW_WAIT * (factor < 1 ? 1.5 : 1)) return void this.redraw(false);
    this.advance(now);
    const step = this.step(), finer = $("beside").checked ? this.finest() : 0, level = finer ? 0 : this.levelAt(step);
    const last = finer && Math.min(step, this.status.states[finer] - 1);
    const shown = this.ready(level, step), beside = finer ? this.ready(finer, last) : null;
    if (shown) this.show(shown, step, level, beside ? `, beside it level ${finer} at step ${last}` : "", speaks);
    const seen = [this.run, level, shown && shown.at, finer, beside && beside.at].join();
    if (this.shown && this.view && (this.stale || seen !== this.seen)) {  // what is the same is not drawn again
      Object.assign(this, { seen, stale: false, drew: now });
      this.put(beside ? [this.shown, beside] : [this.shown]);
      if (!playing || this.view.quality > 1) this.view.setQuality(1);
      this.view.draw();
      clearTimeout(this.rest);
      if (SOFTWARE && !playing) this.rest = setTimeout(() => { this.view.setQuality(2); this.view.draw(); }, RESTS);
      if (playing && this.frames % CHECKED === 0 && this.view.timed() > SLOW) this.view.setQuality(0.5);
      if (shown && shown.samples.has(step)) this.hand.seen(shown.samples.get(step));
    }
    this.frames++;
    if (this.plays) this.redraw(false);
  }
  put(panes) {
    const changed = panes.length !== this.view.shown.length;
    this.view.shown = panes;
    if (changed) this.view.resize();
  }
  finest() {  // the finest level that has begun, or the chosen one
    const begun = this.status.states.findLastIndex((states) => states > 0), wanted = $("level").value;
    return wanted === "" ? begun : Math.min(begun, Number(wanted));
  }
  // A level that can be drawn at a step, or null; what it lacks is asked for.
  ready(level, step) {
    const shown = this.levels.get(level);
    if (shown === undefined) {
      this.levels.set(level, null);  // it is asked for once
      this.ask("scene", { run: this.run, level });
    }
    if (!shown) return null;
    this.want(shown, level, step, step + (this.plays ? AHEAD : 0));
    if (!shown.held.has(step)) return null;
    shown.at = this.plays && step === this.step() && shown.held.has(step + 1) ? Math.min(this.position, this.newest) : step;
    return shown;
  }
  want(shown, level, from, to) {
    const steps = [];
    for (let step = from; step <= to && step < this.status.states[level]; step++) {
      const key = `${level} ${step}`;
      if (!shown.held.has(step) && !this.asked.has(key)) { this.asked.add(key); steps.push(step); }
    }
    if (steps.length) this.ask("states", { run: this.run, level, steps });
  }
  show(shown, step, level, more, speaks) {
    if (this.shown && this.shown !== shown && ![...this.levels.values()].includes(this.shown)) this.shown.dispose();
    this.shown = shown;
    if (!speaks) return;
    const { factor, dt, playing } = this.status, { delay } = this.hand;
    const speed = playing ? `, real-time factor ${factor}${factor && factor < 1 ? ", slower than the clock" : ""}${delay ? `, ${Math.round(delay)} ms from hand to picture` : ""}` : "";
    $("moment").textContent = `step ${step}, ${(step * dt).toFixed(2)} s, level ${level}${more}${speed}`;
    for (const input of [$("scrubber"), $("step")]) if (input !== document.activeElement || this.plays || this.follows) input.value = step;
    $("play").textContent = this.plays || this.follows ? "Stop" : "Play";
  }

  // ---- what the user does
  field(control) {
    const { name, kind, low, high, step } = control, range = kind === "slider";
    const make = (properties) => element("input", { min: low, max: high, step, ...properties });
    const inputs = range ? [make({ type: "range" }), make({ type: "number", step: "any" })]
      : kind === "choice" ? [element("select", {}, ...control.choices.map((text) => element("option", { value: text, textContent: text })))]
        : [element("input", { type: kind === "checkbox" ? kind : "text" })];
    const row = element("label", { title: name }, element("span", { textContent: name }), ...inputs);
    const key = kind === "checkbox" ? "checked" : "value";
    row.name = name;
    row.show = (value) => { for (const input of inputs) if (input !== document.activeElement && String(input[key]) !== String(value)) input[key] = value; };
    row.show(kind === "slider" || kind === "checkbox" ? control.value : control.text);
    const send = (input) => {
      const value = range ? input.valueAsNumber : input[key];
      if (Number.isNaN(value)) return;
      row.show(value);
      this.say("");
      this.ask("change", { name, value });
    };
    for (const input of inputs) input[input.type === "number" ? "onchange" : "oninput"] = () => send(input);
    $("fields").append(row);
    return row;
  }
  listen() {
    const on = (id, work) => { $(id).onclick = () => { this.say(""); work(); }; };
    on("play", () => this.play());
    on("start", () => this.choose(0));
    on("back", () => this.choose(this.step() - 1));
    on("forward", () => this.forward());
    on("newest", () => this.choose(this.newest, !this.status.ended));
    on("pause", () => this.ask(this.status.paused ? "resume" : "pause"));
    on("branch", () => this.ask("branch", { step: this.step() }));
    on("reset", () => this.ask("reset"));
    on("hand", () => (this.status.playing ? this.ask("end_take") : this.ask("play", { step: this.step() })));
    on("keep", () => this.ask("keep", { name: $("name").value }));
    on("fit", () => this.ask("fit"));
    $("scrubber").oninput = () => this.choose(Number($("scrubber").value));
    $("step").onfocus = () => this.choose(this.step());
    $("step").onchange = () => this.choose(Math.round(Number($("step").value)));
    $("level").onchange = $("beside").onchange = () => this.redraw();
    $("drawn").onchange = () => { for (const shown of this.levels.values()) if (shown) shown.drawAs($("drawn").value); this.redraw(); };
    const keys = { " ": "play", Home: "start", ArrowLeft: "back", ArrowRight: "forward", End: "newest" };
    document.addEventListener("keydown", (event) => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, button")) return;
      $(keys[event.key]).click();
      event.preventDefault();
    });
  }
}

function nextName(name) {
  const [, stem, number] = /^(.*_)(\d+)$/.exec(name) || [null, `${name}_`, 1];
  return stem + (Number(number) + 1);
}

window.live = new Live();
