// The hand: what is pressed on the stage is dragged in the plane of the screen, and let go. Each pointer holds one thing.
"use strict";

const DEPTH_OF_NOTCH = 0.04;  // of the camera's size, for one notch of the wheel
const SLIP = 1e-9;  // of a triangle's size: rays through its edges hit it

// Where a ray from `o` along `d` meets a triangle of `rows`: [distance along d, weights of its corners], or null.
function hit(o, d, rows, a, b, c) {
  const at = (i, k) => rows[4 * i + k];
  const e = [0, 1, 2].map((k) => at(b, k) - at(a, k)), f = [0, 1, 2].map((k) => at(c, k) - at(a, k));
  const s = [o.x - at(a, 0), o.y - at(a, 1), o.z - at(a, 2)], ray = [d.x, d.y, d.z];
  const cross = (p, q) => [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
  const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  const p = cross(ray, f), volume = dot(e, p);
  if (volume === 0) return null;
  const q = cross(s, e), u = dot(s, p) / volume, v = dot(ray, q) / volume, t = dot(f, q) / volume;
  return u >= -SLIP && v >= -SLIP && u + v <= 1 + SLIP && t > 0 ? [t, [1 - u - v, u, v]] : null;
}

class Hand {
  constructor(live) {
    Object.assign(this, { live, held: new Map(), number: 0, sample: 0, sent: new Map(), delays: [] });
    const catching = { capture: true, passive: false };  // before three's OrbitControls
    stage.addEventListener("pointerdown", (event) => this.press(event), catching);
    stage.addEventListener("pointermove", (event) => this.drag(event), catching);
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) stage.addEventListener(end, (event) => this.letGo(event), catching);
    stage.addEventListener("wheel", (event) => this.push(event), catching);
  }
  get may() {  // what is played is shown, and no other page has the hand
    const { mine, free, offsets } = this.live.status;
    return offsets && (mine || free) && this.live.view && this.live.follows;
  }

  // The ray through a pointer: origin and direction, from the near to the far end of what the camera sees.
  ray(event) {
    const box = stage.getBoundingClientRect(), { camera } = this.live.view, places = this.live.view.places();
    const left = event.clientX - box.left, top = event.clientY - box.top;
    const place = places.find((one) => left >= one.x && top >= one.y && left < one.x + one.width && top < one.y + one.height) || places[0];
    const x = 2 * (left - place.x) / place.width - 1, y = 1 - 2 * (top - place.y) / place.height;
    const o = new THREE.Vector3(x, y, -1).unproject(camera);
    return [o, new THREE.Vector3(x, y, 1).unproject(camera).sub(o)];
  }
  // What is nearest under a pointer: { point, body, place } or { point, obstacle }, also for a support; null where that cannot be held.
  pick(event) {
    const [o, d] = this.ray(event), { shown } = this.live;
    let found = null;
    for (const part of shown.touchable()) {
      for (let i = 0; i < part.faces.length; i += 3) {
        const corners = part.faces.subarray(i, i + 3), at = hit(o, d, part.rows, ...corners);
        if (at && (!found || at[0] < found.t)) found = { t: at[0], weights: at[1], corners, part };
      }
    }
    if (!found || !(found.part.rest || found.part.movable)) return null;
    const point = o.addScaledVector(d, found.t), { part, corners, weights } = found;
    const support = part.rest && part.supported.get(corners[weights.indexOf(Math.max(...weights))]);
    if (!part.rest || support) return { point, obstacle: support || part.name };
    const place = [0, 1, 2].map((k) => weights.reduce((sum, w, c) => sum + w * part.rest[4 * corners[c] + k], 0));
    return { point, body: part.names[part.bodies[corners[0]]], place: place.slice(0, FLAT ? 2 : 3) };
  }

  press(event) {
    if (event.button !== 0 || !this.may) return;
    const found = this.pick(event);
    if (!found) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    stage.setPointerCapture(event.pointerId);
    const towards = this.live.view.camera.getWorldDirection(new THREE.Vector3()).negate();
    const from = (found.obstacle && this.live.status.offsets[found.obstacle]) || [0, 0, 0];
    this.held.set(event.pointerId, { ...found, number: ++this.number, start: found.point.clone(), from, towards, y: event.clientY });
    this.send(event);
  }
  drag(event) {
    const one = this.held.get(event.pointerId);
    if (!one) return;
    event.stopImmediatePropagation();
    if (event.shiftKey && !FLAT) {
      const { camera } = this.live.view, height = stage.clientHeight;
      const reach = 2 * Math.tan(camera.fov * Math.PI / 360) * camera.position.distanceTo(one.point) / height;
      one.point.addScaledVector(one.towards, (event.clientY - one.y) * reach);
    } else {
      const [o, d] = this.ray(event);
      one.point = o.clone().addScaledVector(d, one.point.clone().sub(o).dot(one.towards) / d.dot(one.towards));
    }
    one.y = event.clientY;
    this.send(event);
  }
  push(event) {
    if (!this.held.size || FLAT) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    for (const one of this.held.values()) one.point.addScaledVector(one.towards, Math.sign(event.deltaY) * DEPTH_OF_NOTCH * DATA.camera.size);
    this.send(event);
  }
  letGo(event) {
    if (!this.held.delete(event.pointerId)) return;
    event.stopImmediatePropagation();
    this.send(event);
  }
  // All that is held now; what is not listed is let go, or stays.
  send(event) {
    const pulls = [], obstacles = {}, dim = FLAT ? 2 : 3;
    for (const { number, body, place, obstacle, point, start, from } of this.held.values()) {
      if (obstacle) obstacles[obstacle] = point.clone().sub(start).toArray().slice(0, dim).map((value, k) => value + from[k]);
      else pulls.push({ number, body, place, point: point.toArray().slice(0, dim) });
    }
    this.sent.set(++this.sample, event.timeStamp);
    this.live.ask("hand", { pulls, obstacles, sample: this.sample });
  }

  // A picture is drawn whose step has used a sample, and all before it: the times from their events to the frame after.
  seen(sample) {
    const used = [...this.sent].filter(([one]) => one <= sample);
    for (const [one] of used) this.sent.delete(one);
    if (used.length) requestAnimationFrame(() => { for (const [, began] of used) this.delays.push(performance.now() - began); });
  }
  get delay() { const sorted = this.delays.slice(-20).sort((a, b) => a - b); return sorted[sorted.length >> 1]; }
}
