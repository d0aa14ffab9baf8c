// The last `capacity` entries, in memory taken once.
export class RingBuffer<T> {
  private readonly entries: (T | undefined)[];
  private first = 0;
  private count = 0;

  constructor(readonly capacity: number) {
    if (!Number.isInteger(capacity) || capacity < 1) throw new RangeError('capacity');
    this.entries = new Array<T | undefined>(capacity).fill(undefined);
  }

  get size(): number {
    return this.count;
  }

  push(entry: T): void {
    this.entries[(this.first + this.count) % this.capacity] = entry;
    if (this.count < this.capacity) this.count += 1;
    else this.first = (this.first + 1) % this.capacity;
  }

  // 0 is the oldest.
  at(index: number): T | undefined {
    if (index < 0 || index >= this.count) return undefined;
    return this.entries[(this.first + index) % this.capacity];
  }

  newest(): T | undefined {
    return this.at(this.count - 1);
  }

  clear(): void {
    this.entries.fill(undefined);
    this.first = 0;
    this.count = 0;
  }

  toArray(): T[] {
    return Array.from({length: this.count}, (_, i) => this.at(i) as T);
  }
}
