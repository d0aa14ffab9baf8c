import type {Language as LanguageCode, Settings} from '../state/settings';
import type {Alarm} from '../state/types';
import {de} from './de';
import {alarms, devices, points, reasons, ui} from './en';
import {zh} from './zh';

export type UiKey = keyof typeof ui;
export type ReasonKey = keyof typeof reasons;
export type AlarmKey = keyof typeof alarms;

export interface Language {
  ui: Record<UiKey, string>;
  points: Record<string, string>;
  devices: Record<string, string>;
  reasons: Record<ReasonKey, string>;
  alarms: Record<AlarmKey, readonly [string, string]>;
}

export const TEXTS: Record<LanguageCode, Language> = {en: {ui, points, devices, reasons, alarms}, de, zh};
export const LANGUAGE_NAMES: Record<LanguageCode, string> = {en: 'English', de: 'Deutsch', zh: '中文'};

export type Params = Record<string, string | number>;

export function Fill(text: string, params: Params): string {
  return text.replace(/\{(\w+)\}/g, (whole, name: string) => (name in params ? String(params[name]) : whole));
}

const own = <T>(table: Record<string, T>, key: string): T | undefined =>
  Object.hasOwn(table, key) ? table[key] : undefined;

// A code without a line is shown as it came: better than nothing, and found by the tests.
const Plain = (code: string) => code.replaceAll('_', ' ');

export class Words {
  private readonly table: Language;

  constructor(readonly language: LanguageCode) {
    this.table = TEXTS[language];
  }

  t(key: UiKey, params: Params = {}): string {
    return Fill(this.table.ui[key], params);
  }

  // For keys put together of a code that came: `phase_` + alarm.phase.
  of(prefix: string, code: string): string {
    return own(this.table.ui as Record<string, string>, prefix + code) ?? Plain(code);
  }

  reason(code: string): string {
    if (code === '') return this.t('reason_nothing');
    return own(this.table.reasons as Record<string, string>, code) ?? Plain(code);
  }

  point(name: string): string {
    return own(this.table.points, name) ?? Plain(name);
  }

  device(id: string): string {
    return own(this.table.devices, id) ?? Plain(id);
  }

  // The process' own English says more (names, figures) and is shown to who reads it. Particulars
  // behind a colon, of the sources that say them so, stay behind a translated cause.
  cause(alarm: Pick<Alarm, 'source' | 'code' | 'cause'>): string {
    const row = own(this.table.alarms as Record<string, readonly [string, string]>, alarm.code);
    if (this.language === 'en') return alarm.cause || row?.[0] || Plain(alarm.code);
    if (!row) return alarm.cause || Plain(alarm.code);
    const colon = alarm.source === 'total_station' || alarm.code === 'calibration_due' ? alarm.cause.indexOf(': ') : -1;
    return colon < 0 ? row[0] : `${row[0]} (${alarm.cause.slice(colon + 2).replace(/\.$/, '')})`;
  }

  response(alarm: Pick<Alarm, 'code' | 'response'>): string {
    const row = own(this.table.alarms as Record<string, readonly [string, string]>, alarm.code);
    if (this.language === 'en') return alarm.response || row?.[1] || '';
    return row?.[1] ?? alarm.response;
  }
}

const kept = new Map<LanguageCode, Words>();

export function WordsFor(settings: Pick<Settings, 'language'>): Words {
  const known = kept.get(settings.language);
  if (known) return known;
  const words = new Words(settings.language);
  kept.set(settings.language, words);
  return words;
}
