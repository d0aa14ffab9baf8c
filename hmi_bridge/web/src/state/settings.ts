// What each screen remembers for itself. Nothing of it changes what is measured or alarmed.
export const LANGUAGES = ['en', 'de', 'zh'] as const;
export type Language = (typeof LANGUAGES)[number];

export interface Settings {
  language: Language;
  theme: 'day' | 'night' | 'auto';
  signs: 'machine' | 'steer';
  angles: 'mm_per_m' | 'deg';
  chainage: 'official' | 'internal';
  sound: boolean;
  behind_m: number;
}

export const BEHIND_CHOICES_M = [10, 20, 50, 100] as const;

const KEY = 'tbm.console.settings';

type Store = Pick<Storage, 'getItem' | 'setItem'>;

export function Defaults(language: string): Settings {
  const known = LANGUAGES.find((one) => language.toLowerCase().startsWith(one));
  return {language: known ?? 'en', theme: 'day', signs: 'machine', angles: 'mm_per_m', chainage: 'official', sound: true, behind_m: 50};
}

function oneOf<T>(value: unknown, choices: readonly T[], otherwise: T): T {
  return choices.includes(value as T) ? (value as T) : otherwise;
}

// Whatever stands there, settings come out that can be used.
export function LoadSettings(store: Store | null, language: string): Settings {
  const none = Defaults(language);
  try {
    const kept = JSON.parse(store?.getItem(KEY) ?? '{}') as Record<string, unknown> | null;
    return {
      language: oneOf(kept?.['language'], LANGUAGES, none.language),
      theme: oneOf(kept?.['theme'], ['day', 'night', 'auto'] as const, none.theme),
      signs: oneOf(kept?.['signs'], ['machine', 'steer'] as const, none.signs),
      angles: oneOf(kept?.['angles'], ['mm_per_m', 'deg'] as const, none.angles),
      chainage: oneOf(kept?.['chainage'], ['official', 'internal'] as const, none.chainage),
      sound: oneOf(kept?.['sound'], [true, false], none.sound),
      behind_m: oneOf(kept?.['behind_m'], BEHIND_CHOICES_M as readonly number[], none.behind_m),
    };
  } catch {
    return none;
  }
}

export function KeepSettings(store: Store | null, settings: Settings): void {
  try {
    store?.setItem(KEY, JSON.stringify(settings));
  } catch {
    // A browser that keeps nothing still shows everything.
  }
}

// `hour` of the screen's place: the night's dress from 19 to 7 o'clock.
export function ThemeAt(theme: Settings['theme'], hour: number): 'day' | 'night' {
  if (theme !== 'auto') return theme;
  return hour >= 19 || hour < 7 ? 'night' : 'day';
}
