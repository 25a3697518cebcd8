// Flat panels in the room, by WebGL: their poses, rendering, and
// intersection with a ray.

import { times } from "./clutch.js";

const VERTEX = `#version 300 es
in vec2 place; out vec2 at; uniform mat4 clip;
void main() { at = vec2(place.x + 0.5, 0.5 - place.y); gl_Position = clip * vec4(place, 0.0, 1.0); }`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec2 at; out vec4 color; uniform sampler2D panel;
void main() { color = texture(panel, at); }`;

/** Turns a vector by a quaternion. */
export function turned(q, [x, y, z]) {
  const [a, b, c] = times(times(q, [x, y, z, 0]), [-q[0], -q[1], -q[2], q[3]]);
  return [a, b, c];
}

/** Product of two 4x4 matrices, column-major. */
function multiply(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      for (let k = 0; k < 4; k += 1) out[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
    }
  }
  return out;
}

/**
 * A panel that faces `from`: rotated by `yaw` (to the left) from the view
 * direction, `rise` meters above the eyes, `away` meters away, of `size` meters.
 */
export function facing(from, orientation, yaw, rise, away, size) {
  const ahead = turned(orientation, [0, 0, -1]);
  const angle = Math.atan2(-ahead[0], -ahead[2]) + yaw;
  const middle = [from[0] - Math.sin(angle) * away, from[1] + rise, from[2] - Math.cos(angle) * away];
  const right = [Math.cos(angle), 0, -Math.sin(angle)];
  const tilt = -Math.atan2(rise, away);
  const up = [Math.sin(angle) * Math.sin(tilt) * -1, Math.cos(tilt), Math.cos(angle) * Math.sin(tilt) * -1];
  const normal = [right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2], right[0] * up[1] - right[1] * up[0]];
  return { middle, right, up, normal, size };
}

/** Intersection of a ray with a panel: {u, v} from its top left, or null. */
export function hit({ middle, right, up, normal, size }, from, orientation) {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const along = turned(orientation, [0, 0, -1]);
  const facingIt = dot(along, normal);
  if (Math.abs(facingIt) < 1e-6) return null;
  const distance = dot(middle.map((value, axis) => value - from[axis]), normal) / facingIt;
  if (distance <= 0) return null;
  const place = from.map((value, axis) => value + along[axis] * distance - middle[axis]);
  const u = dot(place, right) / size[0] + 0.5;
  const v = 0.5 - dot(place, up) / size[1];
  return u >= 0 && u <= 1 && v >= 0 && v <= 1 ? { u, v } : null;
}

export class Painter {
  constructor(gl) {
    this.gl = gl;
    this.textures = new Map();
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    this.program = program;
    this.clip = gl.getUniformLocation(program, "clip");
    this.corners = gl.createVertexArray();
    gl.bindVertexArray(this.corners);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-0.5, -0.5, 0.5, -0.5, -0.5, 0.5, 0.5, 0.5]), gl.STATIC_DRAW);
    const place = gl.getAttribLocation(program, "place");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 2, gl.FLOAT, false, 0, 0);
  }

  /** Uploads an image for the panel of that name. */
  setImage(name, source) {
    const { gl } = this;
    let texture = this.textures.get(name);
    if (!texture) {
      texture = gl.createTexture();
      this.textures.set(name, texture);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      for (const [what, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
        [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, what, value);
    }
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, source);
  }

  /** Shows the text panel under the images; `canvas` is null when it is unchanged. */
  hud(canvas) {
    if (canvas) this.setImage("hud", canvas);
  }

  draw(name, { middle, right, up, normal, size }, view) {
    const { gl } = this;
    const texture = this.textures.get(name);
    if (!texture) return;
    const model = [...right.map((value) => value * size[0]), 0, ...up.map((value) => value * size[1]), 0, ...normal, 0, ...middle, 1];
    gl.useProgram(this.program);
    gl.bindVertexArray(this.corners);
    gl.uniformMatrix4fv(this.clip, false, multiply(multiply(view.projectionMatrix, view.transform.inverse.matrix), model));
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
}
