// Under `regrade view`: the program behind the page learns styles and renders exact films. The
// address's fragment has the token; see pipeline/page/view_session.h.

class Live {
  static begin() {
    const token = location.hash.slice(1);
    return location.protocol === 'http:' && /^[0-9a-f]{64}$/.test(token) ? new Live(token) : null;
  }
  constructor(token) { this.token = token; }
  async ask(method, target, body, headers = {}) {
    let answer;
    try {
      answer = await fetch(target, {method, body, cache: 'no-store', credentials: 'omit',
                                    headers: {...headers, Authorization: 'Bearer ' + this.token}});
    } catch (error) {
      throw new PageError('regrade view does not answer');
    }
    if (answer.ok) return answer;
    const why = await answer.json().catch(() => null);
    throw new PageError(why?.error ?? 'regrade view refuses this');
  }
  // Waits for the job; false if it was cancelled. `meanwhile` runs now and then.
  async finish(words, meanwhile) {
    const ended = offerCancel(() => this.ask('DELETE', '/job').catch(() => {}));
    try {
      for (;;) {
        const job = await (await this.ask('GET', '/job')).json();
        if (job.state === 'failed') throw new PageError(job.error || 'it failed');
        if (job.state !== 'running') return job.state === 'done';
        say(words + (job.stage ? ' ' + Math.round(100 * job.part) + ' %' : '') + (job.note ? ', ' + job.note : ''));
        await meanwhile?.(job);
        await new Promise((done) => setTimeout(done, 500));
      }
    } finally {
      ended();
      say('');
    }
  }
  // The header of a page's style with its weights, or null. `soFar` gets those of the training; with
  // the codes of its splats where `needed()`.
  async learn(file, soFar, needed) {
    if (file.size > 32 << 20) throw new PageError('this picture is larger than 32 MB');
    const name = file.name.normalize('NFKD').replace(/[^\w.-]+/g, '_').slice(-80);
    await this.ask('POST', '/style', file, {'Regrade-Name': name});
    let seen = false;
    const peek = async (job) => {
      // Passes over the splats take time from the training: where codes are needed, one is enough.
      if (job.stage !== 'stylize' || seen && needed()) return;
      const style = await this.ask('GET', '/learning').then((answer) => answer.status === 200 ? answer.json() : null).catch(() => null);
      if (!style) return;
      seen = true;
      await soFar(await withCodes(style, '/learning'));
    };
    const withCodes = async (style, target) => needed()
        ? {...style, codes: new Uint8Array(await (await this.ask('GET', target + '/codes')).arrayBuffer())} : style;
    if (!await this.finish('The style is being learned:', peek)) return null;
    return withCodes(await (await this.ask('GET', '/style')).json(), '/style');
  }
  async film(text) {
    await this.ask('POST', '/film', text);
    if (!await this.finish('The film is being rendered:')) return null;
    return (await this.ask('GET', '/film')).blob();
  }
}

// A dropped picture as a new style of the page, which the page shows as it develops.
async function learnStyle(page, file) {
  if (!page.live) return;
  if (page.learning) return sayBriefly('Another style is being learned.');
  page.learning = true;
  // By way of `page`: the scene may be made again meanwhile.
  const i = page.header.styles.length, picture = page.dropped?.url ?? '';
  let done = false;
  try {
    if (i >= 16) throw new PageError('this page has 16 styles; load it again');
    const soFar = (style) => page.putStyle(i, {...style, picture});
    // The program makes a pass over the splats faster than this page's cores.
    const style = await page.live.learn(file, soFar, () => page.graphics.onCores !== false);
    if (!style) return;
    done = true;
    await page.putStyle(i, {...style, picture});
  } catch (error) {
    if (!(error instanceof PageError)) throw error;
    sayBriefly('The style was not learned: ' + error.message);
  } finally {
    page.learning = false;
    if (!done && page.header.styles.length > i) page.removeStyle(i);
  }
}
