import type { Covariance } from './protocol';

export interface Ellipsoid {
  /** 1-sigma half axes, m, no order. */
  radii: [number, number, number];
  /** Columns: directions of the half axes, right-handed. Row by row, nine numbers. */
  axes: number[];
}

const SWEEPS = 12;

/** Half axes of the 1-sigma ellipsoid: eigenvalues and eigenvectors by Jacobi rotations, exact enough for a picture. */
export function ellipsoid(cov: Covariance): Ellipsoid {
  const [xx, xy, xz, yy, yz, zz] = cov;
  const a = [
    [xx, xy, xz],
    [xy, yy, yz],
    [xz, yz, zz],
  ];
  const v = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ];
  for (let sweep = 0; sweep < SWEEPS; ++sweep) {
    rotate(a, v, 0, 1);
    rotate(a, v, 0, 2);
    rotate(a, v, 1, 2);
  }
  const radius = (i: 0 | 1 | 2): number => Math.sqrt(Math.max(0, a[i]![i]!));
  return { radii: [radius(0), radius(1), radius(2)], axes: v.flat() };
}

/** One rotation in the plane of axes p and q that makes a[p][q] zero. Golub & Van Loan 8.5. */
function rotate(a: number[][], v: number[][], p: number, q: number): void {
  const apq = a[p]![q]!;
  if (Math.abs(apq) < 1e-30) return;
  const theta = (a[q]![q]! - a[p]![p]!) / (2 * apq);
  const t = (theta >= 0 ? 1 : -1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
  const c = 1 / Math.sqrt(t * t + 1);
  const s = t * c;
  for (let k = 0; k < 3; ++k) {
    const akp = a[k]![p]!;
    const akq = a[k]![q]!;
    a[k]![p] = c * akp - s * akq;
    a[k]![q] = s * akp + c * akq;
  }
  for (let k = 0; k < 3; ++k) {
    const apk = a[p]![k]!;
    const aqk = a[q]![k]!;
    a[p]![k] = c * apk - s * aqk;
    a[q]![k] = s * apk + c * aqk;
    const vkp = v[k]![p]!;
    const vkq = v[k]![q]!;
    v[k]![p] = c * vkp - s * vkq;
    v[k]![q] = s * vkp + c * vkq;
  }
}
