// Each number of the operator's page with all that belongs to it, ready to be dressed.
import type {Words} from '../text/index';
import {Chainage, DASHES, Fixed, Signed} from './format';
import {Judge, JudgeNumber, type Judgement, type ReaderClocks, type Receipt} from './freshness';
import type {Settings} from './settings';
import {AngleDigits, AngleFromDeg, AngleFromMmPerM, AngleUnit, DirectionOf, Shown, type Direction} from './signs';
import type {Guidance, Point, Sections, Shield, Timing, TrolleyState} from './types';

export interface Reading {
  id: string;
  label: string;
  unit: string;
  value: number | null;  // in the site's convention and unit
  text: string;  // the value as it would stand there, without unit; of a stale one the last
  sigma: number | null;
  sigma_text: string;
  judgement: Judgement;
  timing: Timing | null;
  validity: string;
  direction: Direction | null;  // of a deviation
  axis: 'right' | 'up' | null;
  plus: string;  // what + means, in words
  limit: number | null;
  gauge: number;  // full deflection of its bar
  trend: string;
  rests_on_s: number | null;
  about_guidance: boolean;  // sources are of interest
}

export type Readings = Map<string, Reading>;

interface Part {
  timing: Timing;
  validity: 'valid' | 'degraded' | 'invalid';
  reason: string;
}

export interface ReadingsInput {
  sections: Partial<Sections>;
  receipt: Receipt | null;
  now: ReaderClocks;
  settings: Settings;
  words: Words;
}

// A place that nothing outside of the unit holds is worth less, whatever its sender says of it.
export function TrolleyPart(state: TrolleyState | null): Part | null {
  if (!state) return null;
  const {timing, status} = state;
  if (status === 'none') return {timing, validity: 'invalid', reason: state.reason};
  if (status === 'fixed') return {timing, validity: 'valid', reason: state.reason};
  return {timing, validity: 'degraded', reason: state.reason || (status === 'gap' ? 'trolley_gap' : 'trolley_open')};
}

// The big numbers: a digit that is always noise is not worth its width.
export function DeviationDigits(mm: number | null): number {
  return mm !== null && Math.abs(mm) >= 99.95 ? 0 : 1;
}

export function ReadingsOf(input: ReadingsInput): Readings {
  const {sections, receipt, now, settings, words} = input;
  const readings: Readings = new Map();
  const judge = (part: Part | null) => Judge(part, receipt, now);
  const put = (
    id: string, label: string, unit: string, part: Part | null, value: number | null, text: string,
    more: Partial<Reading> = {},
  ) => {
    readings.set(id, {
      id, label, unit, value, text,
      sigma: null, sigma_text: DASHES,
      judgement: JudgeNumber(judge(part), value),
      timing: part?.timing ?? null,
      validity: part?.validity ?? '',
      direction: null, axis: null, plus: '', limit: null, gauge: 10, trend: '', rests_on_s: null, about_guidance: true,
      ...more,
    });
  };

  const guidance: Guidance | null = sections.guidance ?? null;
  const machine = sections.machine ?? null;

  const names = guidance?.points.length ? guidance.points.map((p) => p.name) : (machine?.points ?? []).map((p) => p.name);
  for (const name of names) {
    const point = guidance?.points.find((p) => p.name === name) ?? null;
    const part = guidance && point ? {timing: guidance.timing, validity: point.validity, reason: point.reason} : null;
    for (const axis of ['right', 'up'] as const) {
      const value = Shown(point?.[`${axis}_mm`], settings);
      const sigma = point?.[`${axis}_sigma_mm`] ?? null;
      const trend = Shown(point?.[`trend_${axis}_mm_per_m`], settings);
      put(`point.${name}.${axis}`, `${words.point(name)}, ${words.t(axis)}`, 'mm', part, value,
        Signed(value, DeviationDigits(value)), {
          sigma, sigma_text: Fixed(sigma, 1), axis,
          direction: DirectionOf(value, axis),
          plus: words.t(settings.signs === 'steer' ? 'convention_steer' : 'convention_machine'),
          limit: name === guidance?.steer_by ? machine?.deviation_limit_mm ?? null : null,
          gauge: 100,
          trend: trend === null || point?.trend_length_m == null ? '' :
            words.t('trend_over', {value: Signed(trend, 1), m: Fixed(point.trend_length_m, 1)}),
        });
    }
  }

  const steer = SteerPoint(guidance);
  const whole: Part | null = guidance && {timing: guidance.timing, validity: guidance.validity, reason: guidance.reason};
  const official = settings.chainage === 'official';
  const chainage = (official ? steer?.official_chainage_m : steer?.chainage_m) ?? null;
  put('chainage', words.t(official ? 'chainage_official' : 'chainage_internal'), 'm', whole, chainage, Chainage(chainage),
    {sigma: steer?.chainage_sigma_mm ?? null, sigma_text: `${Fixed(steer?.chainage_sigma_mm, 1)} mm`});
  put('ring', words.t('ring'), '', whole, guidance?.ring_number ?? null, guidance?.ring_number == null ? DASHES : String(guidance.ring_number));
  put('stroke', words.t('stroke'), 'mm', whole, guidance?.stroke_mm ?? null, Fixed(guidance?.stroke_mm, 0),
    {sigma: guidance?.stroke_sigma_mm ?? null, sigma_text: Fixed(guidance?.stroke_sigma_mm, 1)});

  const unit = AngleUnit(settings);
  const digits = AngleDigits(settings);
  const gauge = settings.angles === 'deg' ? 1.5 : 25;
  const angle = (id: string, label: string, part: Part | null, value: number | null, sigma: number | null, more: Partial<Reading>) =>
    put(id, label, unit, part, value, Signed(value, digits), {sigma, sigma_text: Fixed(sigma, digits + 1), gauge, ...more});

  // Lead and look-up are directions against the axis: they follow the site's signs as deviations do.
  angle('lead', words.t('lead'), whole, Shown(AngleFromMmPerM(guidance?.lead_right_mm_per_m, settings), settings),
    AngleFromMmPerM(guidance?.lead_right_sigma_mm_per_m, settings), {plus: words.t(settings.signs === 'steer' ? 'convention_steer' : 'lead_plus')});
  angle('look_up', words.t('look_up'), whole, Shown(AngleFromMmPerM(guidance?.lead_up_mm_per_m, settings), settings),
    AngleFromMmPerM(guidance?.lead_up_sigma_mm_per_m, settings), {plus: words.t(settings.signs === 'steer' ? 'convention_steer' : 'look_up_plus')});
  for (const axis of ['right', 'up', 'roll'] as const) {
    angle(`articulation_${axis}`, words.t(`articulation_${axis}`), whole, AngleFromDeg(guidance?.[`articulation_${axis}_deg`], settings),
      AngleFromDeg(guidance?.[`articulation_${axis}_sigma_deg`], settings), {plus: words.t(`articulation_${axis}_plus`)});
  }
  for (const name of ['front', 'rear'] as const) {
    const shield: Shield | null = sections.shields?.[name] ?? null;
    const more = {rests_on_s: shield?.age_s ?? null};
    angle(`roll_${name}`, words.t(`roll_${name}`), shield, AngleFromDeg(shield?.roll_deg, settings), AngleFromDeg(shield?.roll_sigma_deg, settings),
      {...more, plus: words.t('roll_plus'), limit: name === 'front' ? AngleFromDeg(machine?.roll_limit_deg, settings) : null});
    angle(`pitch_${name}`, words.t(`pitch_${name}`), shield, AngleFromDeg(shield?.pitch_deg, settings), AngleFromDeg(shield?.pitch_sigma_deg, settings),
      {...more, plus: words.t('pitch_plus')});
  }
  const front = sections.shields?.front ?? null;
  put('speed', words.t('speed'), 'mm/min', front, front?.speed_mm_per_min ?? null, Fixed(front?.speed_mm_per_min, 0),
    {sigma: front?.speed_sigma_mm_per_min ?? null, sigma_text: Fixed(front?.speed_sigma_mm_per_min, 1), rests_on_s: front?.age_s ?? null});

  const trolley = sections.trolley?.state ?? null;
  const rail = TrolleyPart(trolley);
  const apart = {about_guidance: false};
  put('trolley_distance', words.t('trolley_distance'), 'm', rail, trolley?.distance_m ?? null, Fixed(trolley?.distance_m, 2), apart);
  put('trolley_speed', words.t('trolley_speed'), 'm/s', rail, trolley?.speed_m_per_s ?? null, Fixed(trolley?.speed_m_per_s, 3), apart);
  (['x', 'y', 'z'] as const).forEach((axis, i) => {
    const value = trolley?.position_world_m?.[i] ?? null;
    const sigma = trolley?.position_sigma_mm?.[i] ?? null;
    put(`trolley_${axis}`, `${words.t('trolley')}, ${axis}`, 'm', rail, value, Fixed(value, 4),
      {...apart, sigma, sigma_text: `${Fixed(sigma, 2)} mm`});
  });
  return readings;
}

export function SteerPoint(guidance: Guidance | null): Point | null {
  return guidance?.points.find((point) => point.name === guidance.steer_by) ?? null;
}

// The ellipse that holds the point with 95 %: 2.448 sigma in two dimensions.
export interface Ellipse {
  major_mm: number;
  minor_mm: number;
  turned_deg: number;  // of the major axis, from right towards up
}

const K95 = 2.4477;

export function EllipseOf(point: Pick<Point, 'right_sigma_mm' | 'up_sigma_mm' | 'correlation'> | null): Ellipse | null {
  if (!point || point.right_sigma_mm === null || point.up_sigma_mm === null) return null;
  const a = point.right_sigma_mm ** 2;
  const b = point.up_sigma_mm ** 2;
  const c = (point.correlation ?? 0) * point.right_sigma_mm * point.up_sigma_mm;
  const middle = (a + b) / 2;
  const half = Math.hypot((a - b) / 2, c);
  return {
    major_mm: K95 * Math.sqrt(middle + half),
    minor_mm: K95 * Math.sqrt(Math.max(0, middle - half)),
    turned_deg: (Math.atan2(2 * c, a - b) / 2) * (180 / Math.PI),
  };
}
