// How large a picture may be: drawn in real pixels, so that its letters keep their size.
import {ref} from 'lit/directives/ref.js';

interface Size {
  width: number;
  height: number;
}

export class Sizes {
  private readonly kept = new Map<string, {element: Element | undefined; size: Size; follow: (element: Element | undefined) => void}>();
  private readonly observer: ResizeObserver;

  constructor(changed: () => void) {
    this.observer = new ResizeObserver((entries) => {
      for (const entry of entries) {
        for (const one of this.kept.values()) {
          if (one.element === entry.target) one.size = {width: Math.round(entry.contentRect.width), height: Math.round(entry.contentRect.height)};
        }
      }
      changed();
    });
  }

  of(name: string): Size {
    return this.entry(name).size;
  }

  // For an element's attributes: ${sizes.watch('plan')}.
  watch(name: string) {
    return ref(this.entry(name).follow);
  }

  private entry(name: string) {
    const known = this.kept.get(name);
    if (known) return known;
    const made = {
      element: undefined as Element | undefined,
      size: {width: 0, height: 0},
      follow: (element: Element | undefined) => {
        if (made.element === element) return;
        if (made.element) this.observer.unobserve(made.element);
        made.element = element;
        if (element) this.observer.observe(element);
      },
    };
    this.kept.set(name, made);
    return made;
  }
}
