// The clutch of a headset's controller: its motion since the clutch was
// engaged, in the axes of the chair. Pure.
//
// The headset's axes are x right, y up, z back (WebXR); the chair's are x forward,
// y left, z up. At every engagement the pose is latched anew, so nothing jumps.

const conjugate = ([x, y, z, w]) => [-x, -y, -z, w];

/** Product of two quaternions, x y z w. */
export function times([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** A vector of the headset's space in the axes of the chair. */
export const toChair = ([x, y, z]) => [-z, -x, y];

/** A rotation about the axis `up` of the headset's space, toward the view direction of the head. */
function heading([x, y, z, w]) {
  // Forward is -z; its angle about y.
  const forward = [-2 * (x * z + w * y), -(1 - 2 * (x * x + y * y))];
  return Math.atan2(-forward[0], -forward[1]);
}

/** Turns about the vertical so that `angle` becomes straight ahead. */
function faced([x, y, z], angle) {
  const [c, s] = [Math.cos(-angle), Math.sin(-angle)];
  return [c * x + s * z, y, -s * x + c * z];
}

export class Clutch {
  constructor() {
    this.from = null;
  }

  get engaged() {
    return this.from !== null;
  }

  /**
   * One frame: the squeeze, the controller's pose {position, orientation} or null
   * when it is lost, and the head's orientation. Returns {move, turn} or null.
   */
  frame(squeezed, pose, head) {
    if (!squeezed || !pose) {
      this.from = null;
      // A lost pose must be engaged anew by a fresh squeeze.
      this.spent = squeezed;
      return null;
    }
    if (this.spent) return null;
    if (!this.from) {
      // Ahead is the view direction while engaging.
      this.from = { ...pose, heading: head ? heading(head) : 0 };
    }
    const away = pose.position.map((value, axis) => value - this.from.position[axis]);
    const [x, y, z, w] = times(pose.orientation, conjugate(this.from.orientation));
    const sign = w < 0 ? -1 : 1;
    const turn = toChair(faced([x * sign, y * sign, z * sign], this.from.heading));
    return { move: toChair(faced(away, this.from.heading)), turn: [...turn, w * sign] };
  }

  /** The switch must be released before the clutch engages again. */
  drop() {
    this.from = null;
    this.spent = true;
  }
}
