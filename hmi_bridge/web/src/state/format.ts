// Numbers and times as they stand on the screen. A true minus sign, no minus zero, nothing is dashes.
export const DASHES = '– –';
const MINUS = '−';

export function Fixed(value: number | null | undefined, digits: number): string {
  if (typeof value !== 'number' || !Number.isFinite(value)) return DASHES;
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

export function Signed(value: number | null | undefined, digits: number): string {
  const text = Fixed(value, digits);
  if (text === DASHES || text.startsWith(MINUS) || Number(text) === 0) return text;
  return `+${text}`;
}

// 2345.678 m is 2+345.678.
export function Chainage(value_m: number | null | undefined, digits = 3): string {
  if (typeof value_m !== 'number' || !Number.isFinite(value_m)) return DASHES;
  const unit = 10 ** digits;
  const whole = Math.round(Math.abs(value_m) * unit);
  const kilometres = Math.floor(whole / (1000 * unit));
  const rest = (whole - kilometres * 1000 * unit) / unit;
  const text = `${kilometres}+${rest.toFixed(digits).padStart(digits ? digits + 4 : 3, '0')}`;
  return value_m < 0 && whole !== 0 ? MINUS + text : text;
}

const pad = (value: number) => String(value).padStart(2, '0');

// In the time of the place where the screen stands.
export function ClockTime(utc_ms: number | null | undefined): string {
  if (typeof utc_ms !== 'number' || !Number.isFinite(utc_ms)) return DASHES;
  const at = new Date(utc_ms);
  return `${pad(at.getHours())}:${pad(at.getMinutes())}:${pad(at.getSeconds())}`;
}

export function DateTime(utc_ms: number | null | undefined): string {
  if (typeof utc_ms !== 'number' || !Number.isFinite(utc_ms)) return DASHES;
  const at = new Date(utc_ms);
  return `${at.getFullYear()}-${pad(at.getMonth() + 1)}-${pad(at.getDate())} ${ClockTime(utc_ms)}`;
}

// 0.1 s, 12 s, 4 min, 3 h 05 min: as exact as one can use.
export function Span(ms: number | null | undefined): string {
  if (typeof ms !== 'number' || !Number.isFinite(ms)) return DASHES;
  const s = Math.max(0, ms) / 1000;
  if (s < 10) return `${(Math.floor(s * 10) / 10).toFixed(1)} s`;
  if (s < 120) return `${Math.floor(s)} s`;
  const minutes = Math.floor(s / 60);
  if (minutes < 120) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  return hours < 48 ? `${hours} h ${pad(minutes % 60)} min` : `${Math.floor(hours / 24)} d ${hours % 24} h`;
}
