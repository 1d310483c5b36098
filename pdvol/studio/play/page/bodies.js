// The scene of one pane: bodies and obstacles, as geometries whose vertices are two neighbouring stored states.
"use strict";

// Positions at all states, of which a geometry has two at a time.
class Moving {
  constructor(packed, arrays) {
    const positions = arrays[packed.positions];
    Object.assign(this, { positions, points: positions.points, fields: null, state: -1 });
    this.uniforms = { low: { value: vector(packed.low) }, span: { value: vector(packed.span) }, between: { value: 0 } };
    this.now = new THREE.BufferAttribute(positions.at(0), 4, true);
    this.next = new THREE.BufferAttribute(positions.at(Math.min(1, positions.states - 1)), 4, true);
    this.attributes = { now: this.now, next: this.next };
  }
  withTints(tints) {
    this.attributes.tint = new THREE.BufferAttribute(tints, 4, true);
    this.fieldNow = this.attributes.fieldNow = new THREE.BufferAttribute(new Uint8Array(this.points), 1, true);
    this.fieldNext = this.attributes.fieldNext = new THREE.BufferAttribute(new Uint8Array(this.points), 1, true);
    return this;
  }
  geometry(index) {
    const geometry = new THREE.BufferGeometry();
    for (const [name, attribute] of Object.entries(this.attributes)) geometry.setAttribute(name, attribute);
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return geometry;
  }
  colourBy(fields) {  // States, or null
    this.fields = fields;
    this.state = -1;
  }
  goTo(position) {  // in steps; a few numbers for the graphics card, and an upload where the pair of states changes
    const last = this.positions.states - 1, state = Math.min(Math.floor(position), last), next = Math.min(state + 1, last);
    this.uniforms.between.value = Math.min(position - state, 1);
    if (state === this.state) return;
    this.state = state;
    this.upload(this.now, this.positions.at(state));
    this.upload(this.next, this.positions.at(next));
    if (!this.fields) return;
    this.upload(this.fieldNow, this.fields.at(state));
    this.upload(this.fieldNext, this.fields.at(next));
  }
  upload(attribute, values) {
    attribute.array = values;
    attribute.needsUpdate = true;
  }
}

function surfaceMaterial(moving, choices) {
  const { byField = SHARED.byField, lit = FLAT ? 0 : 1, opacity = 1, darker = 1, map = null, ...more } = choices;
  const uniforms = { ...moving.uniforms, ...SHARED, byField, lit: { value: lit }, opacity: { value: opacity }, darker: { value: darker }, map: { value: map } };
  return new THREE.ShaderMaterial({
    uniforms, defines: map ? { TEXTURED: "" } : {}, vertexShader: SURFACE_VERTEX, fragmentShader: SURFACE_FRAGMENT, side: THREE.DoubleSide,
    transparent: opacity < 1, depthWrite: !FLAT && opacity === 1, depthTest: !FLAT, ...more,
  });
}

const added = (scene, object, order) => {
  object.frustumCulled = false;  // bounds would be those of one state
  object.renderOrder = order;
  scene.add(object);
  return object;
};

function uniqueEdges(faces, points) {
  const keys = new Set();
  for (let i = 0; i < faces.length; i += 3) {
    for (let j = 0; j < 3; j++) {
      const a = faces[i + j], b = faces[i + (j + 1) % 3];
      keys.add(a < b ? a * points + b : b * points + a);
    }
  }
  const edges = new Uint32Array(2 * keys.size);
  let n = 0;
  for (const key of keys) { edges[n++] = Math.floor(key / points); edges[n++] = key % points; }
  return edges;
}

function bytesOf(text) { const c = colour(text); return [255 * c.x, 255 * c.y, 255 * c.z, 255]; }
function tintsOf(points, colourAt) {
  const tints = new Uint8Array(4 * points);
  for (let i = 0; i < points; i++) tints.set(colourAt(i), 4 * i);
  return tints;
}

// One pane's scene: `surfaces`, `edges` to be shown or hidden, `moving` to be put to a time.
class Shown {
  constructor(pane, arrays) {
    this.scene = new THREE.Scene();
    Object.assign(this, { pane, arrays, moving: [], edges: [], surfaces: [], grounds: [], how: "edges", field: "", detailed: true });
    const bodies = arrays[pane.bodies].values, colours = DATA.colours.bodies.map(bytesOf);
    const body = new Moving(pane, arrays);
    this.body = body.withTints(tintsOf(body.points, (i) => colours[bodies[i] % colours.length]));
    this.moving.push(body);
    const faces = arrays[pane.faces].values;
    const surface = body.geometry(faces);
    const pushed = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    this.surfaces.push(added(this.scene, new THREE.Mesh(surface, surfaceMaterial(body, pushed)), 10));
    const share = Math.min(Math.max((FLAT ? 14 : 9) / Math.sqrt(faces.length / 3), 0.16), 0.6);
    const lines = (index, opacity, order) => added(this.scene, new THREE.LineSegments(body.geometry(index),
      surfaceMaterial(body, { lit: 0, darker: 0.45, opacity, transparent: true })), order);
    this.edges.push(Object.assign(lines(uniqueEdges(faces, body.points), share, 11), { share }));
    const uncovered = faces.subarray(0, 3 * pane.uncovered);  // of bodies without a render mesh
    this.parts = [[surface, uncovered.length], [this.edges[0].geometry, uniqueEdges(uncovered, body.points).length]];
    this.details = pane.details.map((mesh) => this.detail(mesh));
    if (FLAT) lines(arrays[pane.outline].values, 0.95, 12);
    const obstacles = pane.obstacles.map((obstacle) => this[obstacle.kind](obstacle));
    if (!FLAT) {
      for (const plane of this.grounds) {
        [[body, surface], ...obstacles.filter(Boolean)].forEach(([moving, geometry]) => this.shadow(plane, moving, geometry));
        for (const { moving, geometry, shadows } of this.details) shadows.push(this.shadow(plane, moving, geometry));
      }
    }
  }

  // A render mesh: `shadows` are on grounds, `wire` its edges once they were asked for.
  detail(mesh) {
    const palette = DATA.colours.bodies, map = mesh.texture === null ? null : this.arrays[mesh.texture].map;
    const moving = this.still(mesh, palette[mesh.body % palette.length]), faces = this.arrays[mesh.faces].values;
    if (map) moving.attributes.spotInMap = new THREE.BufferAttribute(this.arrays[mesh.places].values, 2);
    const geometry = moving.geometry(faces), byField = { value: 0 };
    const surface = added(this.scene, new THREE.Mesh(geometry, surfaceMaterial(moving, { byField, map })), 10);
    return { moving, geometry, faces, surface, shadows: [], wire: null };
  }
  wireOf({ moving, faces }) {
    const material = surfaceMaterial(moving, { byField: { value: 0 }, lit: 0, darker: 0.8, opacity: 0.5, transparent: true });
    return added(this.scene, new THREE.LineSegments(moving.geometry(uniqueEdges(faces, moving.points)), material), 11);
  }

  mesh(obstacle) {
    const moving = this.still(obstacle, DATA.colours.obstacle), geometry = moving.geometry(this.arrays[obstacle.faces].values);
    const opacity = obstacle.opacity;
    added(this.scene, new THREE.Mesh(geometry, surfaceMaterial(moving, { byField: { value: 0 }, opacity })), opacity < 1 ? 20 : 5);
    return opacity < 1 ? null : [moving, geometry];
  }
  polyline(obstacle) {
    const moving = this.still(obstacle, DATA.colours.obstacle), first = moving.positions.at(0), byField = { value: 0 };
    const triangles = obstacle.loops.flatMap((loop) => {
      const at = loop.map((i) => new THREE.Vector2(first[4 * i] * obstacle.span[0], first[4 * i + 1] * obstacle.span[1]));
      return THREE.ShapeUtils.triangulateShape(at, []).flat().map((corner) => loop[corner]);
    });
    obstacle.triangles = new Uint32Array(triangles);
    if (triangles.length) {
      added(this.scene, new THREE.Mesh(moving.geometry(obstacle.triangles), surfaceMaterial(moving, { byField })), 3);
    }
    const edges = moving.geometry(this.arrays[obstacle.edges].values);
    added(this.scene, new THREE.LineSegments(edges, surfaceMaterial(moving, { byField, darker: 0.55 })), 4);
    return null;
  }
  plane(obstacle) {
    const square = new THREE.PlaneGeometry(2, 2);
    const uniforms = { ...SHARED, dark: { value: 0 } };
    for (const name of ["centre", "upright", "along", "across"]) uniforms[name] = { value: new THREE.Vector3() };
    const plane = { places: obstacle.places, uniforms, shadows: [], objects: [] };
    const material = (more) => new THREE.ShaderMaterial({ uniforms: { ...uniforms, ...more }, vertexShader: GROUND_VERTEX,
      fragmentShader: GROUND_FRAGMENT, side: THREE.DoubleSide, depthTest: !FLAT, depthWrite: !FLAT,
      polygonOffset: true, polygonOffsetFactor: 4, polygonOffsetUnits: 4 });
    if (FLAT) {  // a half space without an end, and its border
      plane.objects.push(added(this.scene, new THREE.Mesh(square, material({ reach: { value: 1e9 } })), 0));
      const border = new THREE.BufferGeometry();
      border.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-1, 1, 0, 1, 1, 0]), 3));
      const ink = material({ reach: { value: 1e9 }, ground: { value: colour(DATA.colours.faint) } });
      plane.objects.push(added(this.scene, new THREE.LineSegments(border, ink), 1));
    } else {
      plane.objects.push(added(this.scene, new THREE.Mesh(square, material({})), 0));
    }
    this.grounds.push(plane);
    return null;
  }
  still(obstacle, tint) {
    const moving = new Moving(obstacle, this.arrays), rgb = bytesOf(tint);
    this.moving.push(moving.withTints(tintsOf(moving.points, () => rgb)));
    return moving;
  }
  shadow(plane, moving, geometry) {
    const material = new THREE.ShaderMaterial({ uniforms: { ...plane.uniforms, ...moving.uniforms, dark: { value: 1 } },
      vertexShader: SHADOW_VERTEX, fragmentShader: GROUND_FRAGMENT, side: THREE.DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 });
    const shadow = added(this.scene, new THREE.Mesh(geometry, material), 1);
    plane.objects.push(shadow);
    return shadow;
  }

  // The place of a time [s] among the states; the last one may be nearer to the one before than others are.
  positionAt(time) {
    const { states, dt, end } = this.pane, before = Math.max(states - 2, 0), last = end - before * dt;
    const within = time <= before * dt || last <= 0 ? time / dt : before + (time - before * dt) / last;
    return Math.min(within, states - 1);
  }
  // To a time [s]; what is not stored that far stays at its last state.
  goTo(time) {
    const position = this.positionAt(time);
    for (const moving of this.moving) moving.goTo(position);
    for (const plane of this.grounds) this.putGround(plane, position);
  }
  putGround(plane, position) {
    const state = Math.min(Math.floor(position + 1e-9), plane.places.length - 1), next = plane.places[state + 1] || plane.places[state];
    const place = plane.places[state].map((value, i) => value + (next[i] - value) * (position - Math.floor(position)));
    const half = place.length / 2, point = vector(place.slice(0, half)), normal = vector(place.slice(half)).normalize();
    const { centre, upright, along, across } = plane.uniforms;
    upright.value.copy(normal);
    plane.point = point;
    const reach = FLAT ? 60 * DATA.camera.size : SHARED.reach.value;
    const depth = CAMERA.focus.clone().sub(point).dot(normal);
    centre.value.copy(CAMERA.focus).addScaledVector(normal, -depth);
    if (FLAT) {
      along.value.set(-normal.y, normal.x, 0).multiplyScalar(reach);
      across.value.copy(normal).multiplyScalar(reach);
      centre.value.addScaledVector(normal, -reach);
      return;
    }
    const start = Math.abs(normal.dot(CAMERA.up)) < 0.95 ? CAMERA.up : CAMERA.towards;
    along.value.crossVectors(start, normal).setLength(reach);
    across.value.crossVectors(normal, along.value).setLength(reach);
  }
  seenFrom(camera) {  // from behind a plane would hide the scene
    for (const plane of this.grounds) {
      const shown = FLAT || camera.position.clone().sub(plane.point).dot(plane.uniforms.upright.value) > 0;
      for (const object of plane.objects) object.visible = shown && !object.userData.hidden;
    }
  }
  colourBy(name) {
    const number = name ? this.pane.fields[name] : undefined;
    this.body.colourBy(number === undefined ? null : this.arrays[number]);
    this.field = name;
    this.arrange();
  }
  shapeAs(shape) {
    this.detailed = shape === "render";
    this.arrange();
  }
  // Render meshes in the place of the surfaces of their bodies, unless these are asked for or have the colours of a field.
  arrange() {
    const detailed = this.detailed && !this.field && this.details.length > 0, wired = this.how === "wire";
    for (const [geometry, uncovered] of this.parts) geometry.setDrawRange(0, detailed ? uncovered : Infinity);
    for (const detail of this.details) {
      if (detailed && wired && !detail.wire) detail.wire = this.wireOf(detail);
      if (detail.wire) detail.wire.visible = detailed && wired;
      detail.surface.visible = detailed && !wired;
      for (const shadow of detail.shadows) shadow.userData.hidden = !detailed;
    }
  }
  drawAs(how) {
    this.how = how;
    this.arrange();
    for (const surface of this.surfaces) surface.visible = how !== "wire";
    for (const edges of this.edges) {
      edges.visible = how !== "surface";
      edges.material.uniforms.darker.value = how === "wire" ? 0.8 : 0.45;
      edges.material.uniforms.opacity.value = how === "wire" ? 0.85 : edges.share;
    }
  }
}
