// What a site means by its numbers. The contract is always: the machine against the axis, + right, + up.
import type {Settings} from './settings';

const MM_PER_M_PER_DEG = (1000 * Math.PI) / 180;

export type Direction = 'right' | 'left' | 'up' | 'down' | 'none';

// Of a deviation, or of a direction (lead, look-up), in the site's convention.
export function Shown(value: number | null | undefined, settings: Pick<Settings, 'signs'>): number | null {
  if (typeof value !== 'number' || !Number.isFinite(value)) return null;
  const shown = settings.signs === 'steer' ? -value : value;
  return shown === 0 ? 0 : shown;
}

// Where the arrow points, of a number that is already in the site's convention. What rounds to zero
// points nowhere.
export function DirectionOf(shown: number | null, axis: 'right' | 'up', digits = 1): Direction {
  if (shown === null || Math.abs(shown) < 0.5 * 10 ** -digits) return 'none';
  if (axis === 'right') return shown > 0 ? 'right' : 'left';
  return shown > 0 ? 'up' : 'down';
}

export const ARROWS: Record<Direction, string> = {right: '▶', left: '◀', up: '▲', down: '▼', none: '•'};

// Angles are given in degrees by some parts and in mm/m by others; 1 mm/m is a thousandth of a radian.
export function AngleFromDeg(deg: number | null | undefined, settings: Pick<Settings, 'angles'>): number | null {
  if (typeof deg !== 'number' || !Number.isFinite(deg)) return null;
  return settings.angles === 'deg' ? deg : deg * MM_PER_M_PER_DEG;
}

export function AngleFromMmPerM(mm_per_m: number | null | undefined, settings: Pick<Settings, 'angles'>): number | null {
  if (typeof mm_per_m !== 'number' || !Number.isFinite(mm_per_m)) return null;
  return settings.angles === 'deg' ? mm_per_m / MM_PER_M_PER_DEG : mm_per_m;
}

export function AngleUnit(settings: Pick<Settings, 'angles'>): string {
  return settings.angles === 'deg' ? '°' : 'mm/m';
}

export function AngleDigits(settings: Pick<Settings, 'angles'>): number {
  return settings.angles === 'deg' ? 2 : 1;
}
