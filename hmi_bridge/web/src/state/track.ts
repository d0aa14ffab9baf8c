// What is behind the machine: deviations over the chainage, from the bridge's memory and then live.
import {RingBuffer} from './ring_buffer';
import type {History, Point} from './types';

export interface TrackRow {
  chainage_m: number;
  right_mm: number | null;
  up_mm: number | null;
}

const STEP_M = 0.05;
const CAPACITY = 2100;  // 100 m, and some backing out

export class Track {
  private readonly rows = new RingBuffer<TrackRow>(CAPACITY);
  version = 0;
  point = '';

  load(history: History): void {
    this.rows.clear();
    this.point = history.point;
    const {chainage_m, right_mm, up_mm} = history.columns;
    for (let i = 0; i < chainage_m.length; i += 1) {
      const chainage = chainage_m[i];
      if (typeof chainage !== 'number') continue;
      this.rows.push({chainage_m: chainage, right_mm: right_mm[i] ?? null, up_mm: up_mm[i] ?? null});
    }
    this.version += 1;
  }

  // Only while the point is known, and where the machine has moved.
  add(point: Point): void {
    if (point.chainage_m === null || point.name !== this.point) return;
    const newest = this.rows.newest();
    if (newest && Math.abs(newest.chainage_m - point.chainage_m) < STEP_M) return;
    this.rows.push({chainage_m: point.chainage_m, right_mm: point.right_mm, up_mm: point.up_mm});
    this.version += 1;
  }

  // Oldest first, from `from_m` on, thinned to at most `most` rows. Nulls stay: they are gaps.
  since(from_m: number, most: number): TrackRow[] {
    const rows = this.rows.toArray().filter((row) => row.chainage_m >= from_m);
    if (rows.length <= most) return rows;
    const step = (rows.length - 1) / (most - 1);
    return Array.from({length: most}, (_, i) => rows[Math.round(i * step)] as TrackRow);
  }
}
