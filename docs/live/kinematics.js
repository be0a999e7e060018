// Where the foot is: a port of `src/hopping_leg/robot/kinematics.py`. Angles are (q1, q2), rad; the
// foot's centre is (down, forward) of the hip, m.

import { clamp } from "live/data.js";

export function footPosition({ thigh, shank }, [q1, q2]) {
  return [
    thigh.length * Math.cos(q1) + shank.length * Math.cos(q1 + q2),
    thigh.length * Math.sin(q1) + shank.length * Math.sin(q1 + q2),
  ];
}

// d(down, forward) / d(q1, q2), rows first, m/rad.
export function jacobian({ thigh, shank }, [q1, q2]) {
  const down = -shank.length * Math.sin(q1 + q2);
  const forward = shank.length * Math.cos(q1 + q2);
  return [
    [-thigh.length * Math.sin(q1) + down, down],
    [thigh.length * Math.cos(q1) + forward, forward],
  ];
}

// Joint angles for a foot straight below the hip, knee behind.
export function jointAngles({ thigh: { length: thigh }, shank: { length: shank } }, length) {
  const cosine = (length ** 2 - thigh ** 2 - shank ** 2) / (2 * thigh * shank);
  const knee = -Math.acos(clamp(cosine, -1, 1));
  return [-Math.atan2(shank * Math.sin(knee), thigh + shank * Math.cos(knee)), knee];
}

// Base height if the foot stands on flat, hard ground, m.
export const stanceHeight = (robot, q) => footPosition(robot, q)[0] + robot.foot.radius;
