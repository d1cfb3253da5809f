/** Of several things being loaded, shows the one requested last, whichever arrives first. */
export class Newest {
  private asked = 0;

  /** `shown` is called with what `load` gives, and errors are thrown, unless something else was requested meanwhile. */
  async show<Loaded>(load: () => Promise<Loaded>, shown: (loaded: Loaded) => void): Promise<void> {
    const own = ++this.asked;
    try {
      const loaded = await load();
      if (own === this.asked) shown(loaded);
    } catch (error) {
      if (own === this.asked) throw error;
    }
  }
}
