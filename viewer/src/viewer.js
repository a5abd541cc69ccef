// A mode in motion, drawn by the graphics card: what templates/mode.js draws on a plain canvas, for its page and at its
// word. Points and both parts of the motion are sent once; a frame is two numbers more.
import {
  BufferAttribute, BufferGeometry, DoubleSide, FrontSide, GLSL3, LineSegments, Mesh, NotEqualStencilFunc,
  OrthographicCamera, RawShaderMaterial, ReplaceStencilOp, Scene, WebGLRenderer,
} from "three";

const MOTION = `
precision highp float;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float amplitude; // of the largest displacement [m]
uniform vec2 turn;       // cos φ and sin φ
uniform bool bent;
vec3 displaced(vec3 re, vec3 im) { return re * turn.x - im * turn.y; }
float shown(vec3 u) {
  float share = min(1.0, length(u));
  return bent ? sqrt(share) : share;
}`;
const COLOUR = `
precision highp float;
uniform vec3 ramp[LEVELS];
uniform bool byBody;
out vec4 pixel;
vec3 toned(float share, vec3 body) {
  if (byBody) return body;
  float at = clamp(share, 0.0, 1.0) * float(LEVELS - 1);
  int low = min(int(at), LEVELS - 2);
  return mix(ramp[low], ramp[low + 1], at - float(low));
}`;

const SURFACE = `${MOTION}
uniform float lift; // towards the eye [m]
in vec3 position, re, im, body;
out float share;
out vec3 place, own;
void main() {
  vec3 u = displaced(re, im);
  vec4 at = modelViewMatrix * vec4(position + amplitude * u, 1.0);
  share = shown(u);
  own = body;
  place = at.xyz;
  at.z += lift;
  gl_Position = projectionMatrix * at;
}`;
// The normal is that of the displaced triangle; a lamp at the upper left lights both sides.
const LIT = `${COLOUR}
uniform bool space;
in float share;
in vec3 place, own;
void main() {
  float light = 1.0;
  if (space) {
    vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
    if (normal.z < 0.0) normal = -normal;
    light = 0.6 + 0.4 * max(0.0, dot(normal, normalize(vec3(-0.35, 0.45, 0.82))));
  }
  pixel = vec4(light * toned(share, own), 1.0);
}`;
const INK = `
precision highp float;
out vec4 pixel;
void main() { pixel = vec4(0.0, 0.0, 0.0, 0.32); }`;

// A piece of a line is a strip between its ends, wider by half of its width on all sides: the rest is cut off round.
const PIECE = `${MOTION}
uniform vec2 window; // [pixels]
uniform float width;
in vec3 position, re, im, otherPosition, otherRe, otherIm, body; // its own end first; the other at -1 of way.x
in vec2 way;
out float share, reach;
out vec2 from;
out vec3 own;
vec2 pixels(vec3 point, vec3 u) {
  vec4 at = projectionMatrix * modelViewMatrix * vec4(point + amplitude * u, 1.0);
  return 0.5 * window * (at.xy + 1.0);
}
void main() {
  vec3 u = displaced(re, im), v = displaced(otherRe, otherIm);
  vec2 a = pixels(position, u), b = pixels(otherPosition, v), along = way.x * (b - a);
  reach = length(along);
  along = reach > 0.0 ? along / reach : vec2(1.0, 0.0);
  float edge = 0.5 * width + 1.0;
  vec2 at = a - way.x * edge * along + way.y * edge * vec2(-along.y, along.x);
  from = vec2(way.x > 0.0 ? -edge : reach + edge, way.y * edge);
  share = 0.5 * (shown(u) + shown(v));
  own = body;
  gl_Position = vec4(2.0 * at / window - 1.0, 0.0, 1.0);
}`;
const ROUND = `${COLOUR}
uniform float width;
in float share, reach;
in vec2 from;
in vec3 own;
void main() {
  float away = length(vec2(from.x - clamp(from.x, 0.0, reach), from.y));
  pixel = vec4(toned(share, own), clamp(0.5 * width + 0.5 - away, 0.0, 1.0));
}`;

const FOUR = [0, 1, 2, 3];

function attribute(values, width, kind = Float32Array) {
  return new BufferAttribute(new kind(values), width);
}
function refill(attribute, values) {
  attribute.array.set(values);
  attribute.needsUpdate = true;
}

// Two triangles for each facet with four corners, one for each that repeats its last.
function triangles(facets) {
  const made = new Uint32Array((facets.length / 4) * 6);
  let n = 0;
  for (let f = 0; f < facets.length; f += 4) {
    const [a, b, c, d] = facets.subarray(f, f + 4);
    made.set([a, b, c], n);
    n += 3;
    if (c !== d) {
      made.set([a, c, d], n);
      n += 3;
    }
  }
  return made.subarray(0, n);
}

// Whether WebGL is computed by the processor, by the names of what does so.
function software() {
  const tried = document.createElement("canvas").getContext("webgl2");
  if (!tried) return false;
  const told = tried.getExtension("WEBGL_debug_renderer_info");
  const name = String(tried.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : tried.RENDERER));
  tried.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

class Viewer {
  // Behind `above`, which keeps words, keys and pointer. lost: called once where the graphics card is taken away.
  constructor(above, lost) {
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("aria-hidden", "true");
    // Where the processor computes what WebGL draws, smooth edges and fine screens take too long: docs/app.md.
    this.coarse = software();
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: !this.coarse, stencil: true });
    this.canvas.addEventListener("webglcontextlost", lost);
    this.renderer.debug.onShaderError = () => queueMicrotask(lost);
    this.camera = new OrthographicCamera();
    this.camera.matrixAutoUpdate = this.camera.matrixWorldAutoUpdate = false;
    this.uniforms = Object.fromEntries(Object.entries({
      amplitude: 0, turn: [1, 0], bent: false, ramp: [], byBody: false, space: true, window: [1, 1], width: 3,
    }).map(([name, value]) => [name, { value }]));
    above.before(this.canvas);
  }

  // A model as the page has it decoded, its motion included.
  load(model) {
    this.clear();
    const { data } = model, u = this.uniforms;
    this.model = model;
    u.ramp.value = data.ramp.flat().map((v) => v / 255);
    u.space.value = data.dimension === 3;
    this.motion = ["real", "imag"].map((name) => new BufferAttribute(new Int16Array(model[name]), 3, true));
    const points = attribute(model.points, 3), body = new Float32Array(model.points.length);
    const pale = data.pale.map((colour) => colour.map((v) => v / 255));
    model.body.forEach((own, f) => {
      for (let k = 4 * f; k < 4 * f + 4; k++) body.set(pale[own], 3 * model.facets[k]);
    });
    const shape = (index) => {
      const made = new BufferGeometry();
      made.setAttribute("position", points);
      made.setAttribute("re", this.motion[0]);
      made.setAttribute("im", this.motion[1]);
      made.setAttribute("body", this.bodies);
      made.setIndex(new BufferAttribute(index, 1));
      return made;
    };
    this.bodies = attribute(body, 3);
    this.lift = { value: 0 };
    this.scene = new Scene();
    this.scene.matrixWorldAutoUpdate = false;
    this.put(new Mesh(shape(triangles(model.facets)), this.material(SURFACE, LIT, { lift: { value: 0 } }, {
      side: data.closed ? FrontSide : DoubleSide,
    })));
    // Where edges meet, a pixel is darkened once.
    this.put(new LineSegments(shape(new Uint32Array(model.edges)), this.material(SURFACE, INK, { lift: this.lift }, {
      transparent: true, depthWrite: false, stencilWrite: true, stencilRef: 1, stencilFunc: NotEqualStencilFunc,
      stencilZPass: ReplaceStencilOp,
    })));
    if (model.segmentBody.length) this.lines(model);
    this.change(model);
  }

  // Another motion of the same model.
  change(model) {
    refill(this.motion[0], model.real);
    refill(this.motion[1], model.imag);
    this.uniforms.bent.value = model.data.bent;
    if (this.ends) this.ends.forEach(([attribute, name, other]) => refill(attribute, this.atEnds(model[name], other)));
  }

  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.uniforms.window.value = [width, height];
    this.uniforms.width.value = Math.max(3, width / 260);
  }

  paper(colour) {
    this.renderer.setClearColor(colour);
  }

  // axes: what is right, up and towards the eye; factor: pixels for a metre; x, y: where the middle is [pixels]; far: how
  // far from it anything may be [m].
  draw({ axes, factor, x, y, far, amplitude, phase, byBody }) {
    const { camera, uniforms: u } = this, [width, height] = u.window.value;
    Object.assign(camera, { left: -x / factor, right: (width - x) / factor, top: y / factor, bottom: (y - height) / factor, near: -far, far });
    camera.updateProjectionMatrix();
    const [r, t, e] = axes;
    camera.matrixWorld.set(r[0], t[0], e[0], 0, r[1], t[1], e[1], 0, r[2], t[2], e[2], 0, 0, 0, 0, 1);
    camera.matrixWorldInverse.copy(camera.matrixWorld).invert();
    u.amplitude.value = amplitude;
    u.turn.value = [Math.cos(phase), Math.sin(phase)];
    u.byBody.value = byBody;
    this.lift.value = 2 / factor;
    this.renderer.render(this.scene, camera);
  }

  end() {
    this.clear();
    this.renderer.dispose();
    this.canvas.remove();
  }

  material(vertexShader, fragmentShader, own, options) {
    return new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader, fragmentShader, uniforms: { ...this.uniforms, ...own },
      defines: { LEVELS: this.model.data.ramp.length }, ...options,
    });
  }

  put(drawn) {
    drawn.frustumCulled = false;
    drawn.renderOrder = this.scene.children.length;
    this.scene.add(drawn);
  }

  lines(model) {
    const { data, segmentBody } = model, count = segmentBody.length, made = new BufferGeometry();
    this.ends = [];
    for (const [name, key] of [["position", "points"], ["re", "real"], ["im", "imag"]]) {
      for (const other of [false, true]) {
        const values = this.atEnds(model[key], other);
        const kept = new BufferAttribute(values, 3, key !== "points");
        made.setAttribute(other ? `other${name[0].toUpperCase()}${name.slice(1)}` : name, kept);
        if (key !== "points") this.ends.push([kept, key, other]);
      }
    }
    const corners = [...segmentBody].flatMap((own) => FOUR.flatMap(() => data.colours[own].map((v) => v / 255)));
    made.setAttribute("body", attribute(corners, 3));
    made.setAttribute("way", attribute(Array.from({ length: count }, () => [1, -1, 1, 1, -1, -1, -1, 1]).flat(), 2));
    made.setIndex(attribute(Array.from({ length: count }, (_, s) => [0, 2, 1, 1, 2, 3].map((k) => 4 * s + k)).flat(), 1, Uint32Array));
    this.put(new Mesh(made, this.material(PIECE, ROUND, {}, { transparent: true, depthTest: false, depthWrite: false, side: DoubleSide })));
  }

  // Values of points at the four corners of each piece: two at its first end and two at its second, or the other way.
  atEnds(values, other) {
    const { segments } = this.model, made = new values.constructor(6 * segments.length);
    for (let s = 0; s < segments.length; s += 2) {
      for (const k of FOUR) {
        const at = 3 * segments[s + ((k > 1) !== other ? 1 : 0)];
        made.set(values.subarray(at, at + 3), 6 * s + 3 * k);
      }
    }
    return made;
  }

  clear() {
    for (const drawn of this.scene?.children ?? []) {
      drawn.geometry.dispose();
      drawn.material.dispose();
    }
    this.scene = this.ends = null;
  }
}

// One that draws behind a canvas, or none where there is no WebGL.
globalThis.stridorViewer = (above, lost) => {
  const { error } = console;
  console.error = () => {}; // three tells what the page has another way for
  try {
    return new Viewer(above, lost);
  } catch {
    return null;
  } finally {
    console.error = error;
  }
};
