// The stage: which panes are where, one camera for all of them, and the picture.
"use strict";

const $ = (id) => document.getElementById(id);
const element = (name, properties, ...children) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};
const stage = document.getElementById("stage"), canvas = document.getElementById("canvas");

class View {
  constructor(shown, smooth = true) {  // `smooth`: edges, by the graphics card
    this.shown = shown;  // by pane; null for a pane without states
    this.layout = "grid";
    this.first = this.shown.findIndex(Boolean);
    this.second = this.shown.findIndex((s, i) => s && i > this.first);
    if (this.second < 0) this.second = this.first;
    Object.assign(this, { wipe: 0.5, quality: 1 });
    this.size = [1, 1];
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: smooth });
    this.renderer.setClearColor(new THREE.Color(DATA.colours.background));
    this.renderer.autoClear = false;
    this.camera = FLAT ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera(DATA.camera.angle);
    this.camera.up.copy(CAMERA.upward);
    this.controls = new THREE.OrbitControls(this.camera, stage);
    this.controls.enableRotate = !FLAT;
    this.controls.screenSpacePanning = true;
    if (FLAT) { this.controls.mouseButtons.LEFT = 2; this.controls.touches.ONE = 1; }  // three's PAN, both
    this.moved = false;
    this.controls.addEventListener("start", () => { this.moved = true; });
  }

  // Rectangles of the panes on the stage [pixels]: { pane, x, y, width, height } and, in a wipe, from and to.
  places() {
    const [width, height] = this.size;
    if (this.layout === "one") return [{ pane: this.first, x: 0, y: 0, width, height }];
    if (this.layout === "wipe") {
      const at = Math.round(this.wipe * width);
      return [{ pane: this.first, x: 0, y: 0, width, height, from: 0, to: at }, { pane: this.second, x: 0, y: 0, width, height, from: at, to: width }];
    }
    const count = this.shown.length, columns = DATA.columns || this.bestColumns(count), rows = Math.ceil(count / columns);
    return this.shown.map((_, pane) => {
      const column = pane % columns, row = Math.floor(pane / columns);
      const x = Math.round(column * width / columns), y = Math.round(row * height / rows);
      return { pane, x, y, width: Math.round((column + 1) * width / columns) - x, height: Math.round((row + 1) * height / rows) - y };
    });
  }
  bestColumns(count) {  // those with which the content is largest
    const [width, height] = this.size, aspect = DATA.camera.aspect;
    let best = 1, most = 0;
    for (let columns = 1; columns <= count; columns++) {
      const size = Math.min(width / columns / aspect, height / Math.ceil(count / columns));
      if (size > most * 1.001) { most = size; best = columns; }
    }
    return best;
  }

  resize() {
    const box = stage.getBoundingClientRect();
    this.size = [Math.max(1, box.width), Math.max(1, box.height)];
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2) * this.quality);
    this.renderer.setSize(...this.size, false);
    if (!this.moved) this.look("reset");
  }

  setQuality(quality) {  // pixels drawn for one of the screen, along a side
    if (quality === this.quality) return;
    this.quality = quality;
    this.resize();
  }
  timed() {  // ms until what has been asked for is drawn
    const begin = performance.now(), gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - begin;
  }

  // Reset, or from the front, a side, or the top, with everything in the picture.
  look(direction) {
    const { width, height } = this.places()[0], narrow = Math.max(1, DATA.camera.aspect / (width / height));
    const towards = { reset: CAMERA.towards, front: CAMERA.front, side: CAMERA.side, top: CAMERA.upward }[direction].clone();
    if (direction === "top") towards.addScaledVector(CAMERA.front, 1e-3).normalize();
    this.controls.target.copy(CAMERA.focus);
    this.camera.position.copy(CAMERA.focus).addScaledVector(towards, DATA.camera.distance * narrow);
    this.camera.zoom = 1 / narrow;
    if (!FLAT) {
      this.camera.zoom = 1;
      this.camera.near = 0.02 * DATA.camera.distance;
      this.camera.far = DATA.camera.distance * narrow + 30 * DATA.camera.size;
    } else {
      this.camera.near = -DATA.camera.size;
      this.camera.far = DATA.camera.distance * narrow + DATA.camera.size;
    }
    this.controls.update();
    this.moved = direction !== "reset";
  }
  setAspect(aspect) {
    if (FLAT) {
      const half = DATA.camera.half_height;
      Object.assign(this.camera, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    } else {
      this.camera.aspect = aspect;
    }
    this.camera.updateProjectionMatrix();
  }

  draw(time) {
    const renderer = this.renderer, height = this.size[1];
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    for (const place of this.places()) {
      const shown = this.shown[place.pane], from = place.from ?? place.x, to = place.to ?? place.x + place.width;
      if (!shown || to <= from) continue;
      shown.goTo(time);
      shown.seenFrom(this.camera);
      this.setAspect(place.width / place.height);
      renderer.setViewport(place.x, height - place.y - place.height, place.width, place.height);
      renderer.setScissor(from, height - place.y - place.height, to - from, place.height);
      renderer.render(shown.scene, this.camera);
    }
  }
}
