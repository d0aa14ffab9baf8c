// How long to wait before the next attempt to connect: soon at first, never longer than two seconds.
export function BackoffMs(attempt: number): number {
  return Math.min(2000, 300 * 1.6 ** Math.max(0, Math.min(attempt, 20)));
}
