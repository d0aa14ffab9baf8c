// Tones through WebAudio. A browser gives none before the page was touched once.
import {PATTERNS} from './alarms';
import type {Urgency} from './types';

export class Sound {
  private context: AudioContext | null = null;
  private next_s = 0;
  private playing: Urgency | null = null;

  // To be called in the hand of a user's touch.
  unlock(): void {
    if (typeof AudioContext === 'undefined') return;
    this.context ??= new AudioContext();
    if (this.context.state === 'suspended') void this.context.resume().catch(() => undefined);
  }

  get isBlocked(): boolean {
    return this.context?.state !== 'running';
  }

  // A few times a second: sets the next tones shortly before they are due.
  tick(wanted: Urgency | null): void {
    if (!this.context || this.context.state !== 'running') return;
    const now = this.context.currentTime;
    if (wanted !== this.playing) {
      this.playing = wanted;
      this.next_s = now + 0.05;
    }
    if (!wanted || now + 0.3 < this.next_s) return;
    this.play(wanted, Math.max(now + 0.05, this.next_s));
    this.next_s = Math.max(now, this.next_s) + PATTERNS[wanted].period_s;
  }

  play(urgency: Urgency, at_s?: number): void {
    const {context} = this;
    if (!context || context.state !== 'running') return;
    const pattern = PATTERNS[urgency];
    const begin = at_s ?? context.currentTime + 0.05;
    for (const offset of pattern.starts_s) {
      const tone = context.createOscillator();
      const volume = context.createGain();
      tone.frequency.value = pattern.frequency_hz;
      const start = begin + offset;
      const end = start + pattern.length_s;
      volume.gain.setValueAtTime(0, start);
      volume.gain.linearRampToValueAtTime(0.25, start + 0.01);
      volume.gain.setValueAtTime(0.25, end - 0.02);
      volume.gain.linearRampToValueAtTime(0, end);
      tone.connect(volume).connect(context.destination);
      tone.onended = () => {
        tone.disconnect();
        volume.disconnect();
      };
      tone.start(start);
      tone.stop(end);
    }
  }
}
