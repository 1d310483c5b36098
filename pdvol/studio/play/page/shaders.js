// Programs of the graphics card. Positions are interpolated between two stored states and normals are those of the flat
// triangles, so that the processor touches no vertex. Lights are those of pdvol/studio/draw/renderer.py.
"use strict";

const PLACED = `
attribute vec3 now;
attribute vec3 next;
uniform vec3 low, span;
uniform float between;
vec3 placed() { return low + span * mix(now, next, between); }
`;

const SURFACE_VERTEX = PLACED + `
attribute vec3 tint;
attribute float fieldNow;
attribute float fieldNext;
varying vec3 place, shade;
varying float field;
#ifdef TEXTURED
attribute vec2 spotInMap;
varying vec2 spot;
#endif
void main() {
#ifdef TEXTURED
  spot = spotInMap;
#endif
  place = placed();
  shade = tint;
  field = mix(fieldNow, fieldNext, between);
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;

const RAMP = ["#e9e2d4", "#f0bd4f", "#ec8a4d", "#d0473f", "#8c2350", "#3c1642"];

const SURFACE_FRAGMENT = `
uniform vec3 ramp[${RAMP.length}];
uniform vec3 mainLight, sideLight, backLight;
uniform float byField, lit, opacity, darker;
varying vec3 place, shade;
varying float field;
#ifdef TEXTURED
uniform sampler2D map;
varying vec2 spot;
#endif
vec3 colourOf(float value) {
  float at = clamp(value, 0.0, 1.0) * ${RAMP.length - 1}.0;
  vec3 colour = ramp[0];
  for (int i = 0; i < ${RAMP.length - 1}; i++) colour = mix(colour, ramp[i + 1], clamp(at - float(i), 0.0, 1.0));
  return colour;
}
void main() {
#ifdef TEXTURED
  vec3 own = texture2D(map, spot).rgb;
#else
  vec3 own = shade;
#endif
  vec3 colour = (byField > 0.5 ? colourOf(field) : own) * darker;
  if (lit > 0.5) {
    vec3 n = normalize(cross(dFdx(place), dFdy(place)));
    vec3 light = vec3(0.42) + 0.8 * (0.74 * max(dot(n, mainLight), 0.0) * vec3(1.0, 0.965, 0.918)
      + 0.34 * max(dot(n, sideLight), 0.0) * vec3(0.875, 0.918, 1.0) + 0.3 * max(dot(n, backLight), 0.0));
    colour *= light;
  }
  gl_FragColor = vec4(min(colour, 1.0), opacity);
}`;

// The ground of a 3D scene: a square about the point below the focus that fades into the background, and the shadows of
// what is above it, along the main light.
const GROUND_VERTEX = `
uniform vec3 centre, along, across;
varying vec3 place;
void main() {
  place = centre + position.x * along + position.y * across;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;
const SHADOW_VERTEX = PLACED + `
uniform vec3 centre, upright, mainLight;
varying vec3 place;
void main() {
  place = placed();
  place -= mainLight * dot(place - centre, upright) / max(dot(mainLight, upright), 0.5);
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;
const GROUND_FRAGMENT = `
uniform vec3 centre, ground, background;
uniform float reach, dark;
varying vec3 place;
void main() {
  float fade = smoothstep(0.2, 0.95, length(place - centre) / reach);
  gl_FragColor = vec4(mix(ground * mix(1.0, 0.86, dark), background, fade), 1.0);
}`;

const vector = (values) => new THREE.Vector3(values[0], values[1], values[2] || 0);
const colour = (text) => { const c = parseInt(text.slice(1), 16); return new THREE.Vector3((c >> 16) / 255, ((c >> 8) & 255) / 255, (c & 255) / 255); };

// What all materials share: colours, and the lights and the size that belong to the first camera.
const CAMERA = {};
let FLAT = false;
const SHARED = {
  mainLight: { value: null },
  sideLight: { value: null },
  backLight: { value: null },
  ramp: { value: RAMP.map(colour) },
  byField: { value: 0 },
  ground: { value: colour(DATA.colours.ground) },
  background: { value: colour(DATA.colours.background) },
  reach: { value: 0 },
};
function useCamera(camera) {
  DATA.camera = camera;
  FLAT = camera.dim === 2;
  for (const [key, value] of Object.entries(camera)) CAMERA[key] = Array.isArray(value) ? vector(value) : value;
  const light = (a, b, c) => new THREE.Vector3().addScaledVector(CAMERA.up, a).addScaledVector(CAMERA.right, b).addScaledVector(CAMERA.towards, c).normalize();
  SHARED.mainLight.value = light(0.75, -0.42, 0.5);
  SHARED.sideLight.value = light(0.1, 0.9, 0.5);
  SHARED.backLight.value = light(1, 0, -0.6);
  SHARED.reach.value = 1.7 * camera.size;
}
if (DATA.camera) useCamera(DATA.camera);
