// What the page decides about alarms: order, address of a command, how long, and what is heard.
import type {Alarm, CommandRequest, Urgency} from './types';

const RANK: Record<Urgency, number> = {high: 0, medium: 1, low: 2};
export const URGENCIES: Urgency[] = ['high', 'medium', 'low'];

export const KeyOf = (alarm: Pick<Alarm, 'source' | 'code'>) => `${alarm.source}/${alarm.code}`;

// By the bridge's clock, so that a shelf ends on the page when it ends in the process.
export function IsShelved(alarm: Alarm, bridge_now_ms: number): boolean {
  return alarm.shelved_until_utc_ms !== null && alarm.shelved_until_utc_ms > bridge_now_ms;
}

export function IsUnacknowledged(alarm: Alarm): boolean {
  return alarm.phase === 'unacknowledged' || alarm.phase === 'returned_unacknowledged';
}

export function Stands(alarm: Alarm): boolean {
  return alarm.phase === 'unacknowledged' || alarm.phase === 'acknowledged';
}

// Unacknowledged before acknowledged, then by urgency, what stands before what has returned, and of
// these the first raised first.
export function InOrder(list: readonly Alarm[]): Alarm[] {
  const rank = (alarm: Alarm) =>
    (IsUnacknowledged(alarm) ? 0 : 100) + RANK[alarm.urgency] * 10 + (Stands(alarm) ? 0 : 1);
  return [...list].sort(
    (a, b) => rank(a) - rank(b) || (a.raised_at_utc_ms ?? Infinity) - (b.raised_at_utc_ms ?? Infinity) || KeyOf(a).localeCompare(KeyOf(b)));
}

export interface AlarmView {
  active: Alarm[];  // in order, not shelved
  shelved: Alarm[];
  worst: Alarm | null;  // the banner's
  counts: Record<Urgency, number>;  // of what stands or waits to be acknowledged, not shelved
  unacknowledged: number;
}

export function ViewOf(list: readonly Alarm[], bridge_now_ms: number): AlarmView {
  const ordered = InOrder(list);
  const shelved = ordered.filter((alarm) => IsShelved(alarm, bridge_now_ms));
  const active = ordered.filter((alarm) => !IsShelved(alarm, bridge_now_ms) && alarm.phase !== 'normal');
  const counts: Record<Urgency, number> = {high: 0, medium: 0, low: 0};
  for (const alarm of active) counts[alarm.urgency] += 1;
  const waiting = active.filter(IsUnacknowledged);
  return {active, shelved, worst: waiting[0] ?? active[0] ?? null, counts, unacknowledged: waiting.length};
}

// High ones for at most half an hour, all others for a shift.
export const SHELF_MINUTES = [15, 30, 60, 480] as const;

export function ShelfChoices(urgency: Urgency): number[] {
  return SHELF_MINUTES.filter((minutes) => urgency !== 'high' || minutes <= 30);
}

export type AlarmVerb = 'acknowledge' | 'shelve' | 'unshelve';

// The process that watches obeys for its own alarms, the bridge for all others.
export function RequestFor(alarm: Pick<Alarm, 'source' | 'code' | 'origin'>, verb: AlarmVerb, because: string, minutes?: number): CommandRequest {
  const own = alarm.origin === 'process';
  const code = own ? alarm.code : KeyOf(alarm);
  return {
    addressee: own ? alarm.source : 'hmi_bridge',
    verb,
    argument: verb === 'shelve' ? `${code} ${minutes ?? 0}` : code,
    because,
  };
}

export interface Beeps {
  frequency_hz: number;
  starts_s: number[];
  length_s: number;
  period_s: number;
}

// Told apart with eyes closed: number, height and pace of the tones.
export const PATTERNS: Record<Urgency, Beeps> = {
  high: {frequency_hz: 988, starts_s: [0, 0.18, 0.36, 0.54], length_s: 0.12, period_s: 1.6},
  medium: {frequency_hz: 740, starts_s: [0, 0.3], length_s: 0.2, period_s: 4},
  low: {frequency_hz: 523, starts_s: [0], length_s: 0.3, period_s: 12},
};

// What is to be heard: the most urgent that nobody has acknowledged and nobody has shelved. One that
// has returned is not worth a noise. A lost connection is as urgent as can be: nothing is watched.
export function SoundFor(
  list: readonly Alarm[],
  state: {sound: boolean; muted_until_ms: number; bridge_now_ms: number; now_ms: number; is_down: boolean},
): Urgency | null {
  if (!state.sound || state.now_ms < state.muted_until_ms) return null;
  const heard = list.filter((alarm) => alarm.phase === 'unacknowledged' && !IsShelved(alarm, state.bridge_now_ms));
  const worst = URGENCIES.find((urgency) => heard.some((alarm) => alarm.urgency === urgency)) ?? null;
  return state.is_down ? 'high' : worst;
}
