// What may be asked of the total station now, and how it is written.
import type {SetUp, Station} from './types';

export type MoveStep = 'idle' | 'away' | 'proposed';

// Paused, a set-up is suspect with the reason that a move is under way.
export function StepOf(station: Station | null): MoveStep {
  if (station?.proposed && station.proposed.state !== 'none') return 'proposed';
  if (station?.in_use?.reason === 'station_moving') return 'away';
  return 'idle';
}

export type Closure = 'good' | 'bad' | 'missing';

export function ClosureOf(proposed: SetUp | null): Closure {
  if (!proposed || proposed.closure_worst_mm === null || proposed.closure_tolerance_mm === null) return 'missing';
  return proposed.closure_worst_mm <= proposed.closure_tolerance_mm ? 'good' : 'bad';
}

// "E,N,U,REFERENCE" or "E,N,U,DEGREES" (devices/README.md), or which of the two fields is wrong.
export function MoveArgument(place: string, aim: string): {argument: string} | {fault: 'place' | 'aim'} {
  const numbers = place.split(/[,;\s]+/).filter((part) => part !== '').map(Number);
  if (numbers.length !== 3 || numbers.some((number) => !Number.isFinite(number))) return {fault: 'place'};
  const aimed = aim.trim();
  if (aimed === '' || aimed.includes(',') || aimed.length > 32) return {fault: 'aim'};
  return {argument: [...numbers, aimed].join(',')};
}
