// What the design does in front of the machine, for one line of text.
import type {Machine} from './types';

type Axis = Machine['axis'];

// Less is a straight line to anybody who steers.
const STRAIGHT_PER_KM = 0.02;

export interface Bend {
  kind: 'straight' | 'curve' | 'transition';
  side: 'right' | 'left' | null;
  radius_m: number | null;
}

export interface DesignAhead {
  now: Bend;
  next: (Bend & {in_m: number}) | null;
  gradient_percent: number | null;
  next_gradient: {percent: number; in_m: number} | null;
  ends_in_m: number | null;
}

function IndexBefore(axis: Axis, chainage_m: number): number {
  let low = 0;
  let high = axis.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if ((axis[middle]?.chainage_m ?? Infinity) <= chainage_m) low = middle;
    else high = middle - 1;
  }
  return low;
}

function BendAt(axis: Axis, i: number): Bend {
  const here = axis[i]?.curvature_per_km ?? 0;
  const after = axis[i + 1]?.curvature_per_km ?? here;
  const isChanging = Math.abs(after - here) > Math.max(STRAIGHT_PER_KM, 0.01 * Math.abs(here));
  const strong = Math.abs(after) > Math.abs(here) ? after : here;
  if (Math.abs(strong) <= STRAIGHT_PER_KM) return {kind: 'straight', side: null, radius_m: null};
  const side = strong > 0 ? 'right' : 'left';
  if (isChanging) return {kind: 'transition', side, radius_m: null};
  return {kind: 'curve', side, radius_m: 1000 / Math.abs(here)};
}

const SameBend = (a: Bend, b: Bend) =>
  a.kind === b.kind && a.side === b.side &&
  (a.radius_m === null || b.radius_m === null || Math.abs(a.radius_m - b.radius_m) <= 0.02 * a.radius_m);

export function DesignAt(axis: Axis, chainage_m: number | null, end_m: number, look_m = 100): DesignAhead | null {
  if (chainage_m === null || axis.length === 0) return null;
  const first = IndexBefore(axis, chainage_m);
  const now = BendAt(axis, first);
  let next: DesignAhead['next'] = null;
  let next_gradient: DesignAhead['next_gradient'] = null;
  const gradient_percent = axis[first]?.gradient_percent ?? null;
  for (let i = first + 1; i < axis.length; i += 1) {
    const row = axis[i];
    if (!row || row.chainage_m - chainage_m > look_m) break;
    const in_m = row.chainage_m - chainage_m;
    const bend = i + 1 < axis.length ? BendAt(axis, i) : null;
    if (!next && bend && !SameBend(bend, now)) next = {...bend, in_m};
    if (!next_gradient && gradient_percent !== null && row.gradient_percent !== null &&
        Math.abs(row.gradient_percent - gradient_percent) > 0.05) {
      next_gradient = {percent: row.gradient_percent, in_m};
    }
  }
  const left_m = end_m - chainage_m;
  return {now, next, gradient_percent, next_gradient, ends_in_m: left_m < look_m ? left_m : null};
}
