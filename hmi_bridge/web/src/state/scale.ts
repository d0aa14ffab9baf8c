// Scales in fixed steps: a picture that breathes cannot be compared with that of a minute ago.
export const TARGET_STEPS_MM = [20, 50, 100, 200, 500] as const;

// The smallest step that holds `largest_mm` with a tenth to spare; one that holds no longer is left at
// once, one that would do is entered only below 70 % of it, so that it does not flicker.
export function ScaleFor(largest_mm: number, current_mm: number | null): number {
  const holds = (step: number, share: number) => largest_mm <= step * share;
  const last = TARGET_STEPS_MM[TARGET_STEPS_MM.length - 1] as number;
  const needed = TARGET_STEPS_MM.find((step) => holds(step, 0.9)) ?? last;
  if (current_mm === null || needed >= current_mm) return needed;
  return TARGET_STEPS_MM.find((step) => holds(step, 0.7)) ?? current_mm;
}

// Lines of a grid at 1, 2 or 5 times a power of ten, about `wanted` of them.
export function TickStep(span: number, wanted: number): number {
  const rough = Math.max(span, 1e-9) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const head = rough / power;
  return (head <= 1 ? 1 : head <= 2 ? 2 : head <= 5 ? 5 : 10) * power;
}

export function Ticks(from: number, to: number, wanted: number): number[] {
  const step = TickStep(to - from, wanted);
  const ticks: number[] = [];
  for (let i = Math.ceil(from / step - 1e-9); i * step <= to + 1e-9; i += 1) ticks.push(i * step);
  return ticks;
}
