// Brings the field of the page onto the graphics processor: unpacked by a worker, so that the page answers meanwhile.

function textOf(id) {
  const element = document.getElementById(id);
  if (!element) throw new PageError('a part of the page is missing: ' + id);
  return element.textContent;
}

const bytesOf = (id) => inflated(textOf(id), id);

// All of the field, or its first part; see decodeField.
async function decodedField(header, whole, progress) {
  const {basis, color, splats, center, radius} = header;
  const residuals = header.styles.some((s) => s.residual), texts = (name) => (whole ? ['coarse_', ''] : ['coarse_']).map((part) => textOf(part + name));
  const text = {shape: texts('shape'), color: texts('color')};
  const task = {header: {basis, color, splats, center, radius, residuals}, text};
  const made = whole && await decodedByWorker(task, progress);
  if (made) return made;
  let waited = performance.now();  // browsers make timers that follow each other last for milliseconds
  return decodeField(task.header, text, async (part) => {
    progress(part);
    if (performance.now() - waited < 15) return;
    await wait();
    waited = performance.now();
  });
}

let workersRun = typeof Worker !== 'undefined';

// Null where workers cannot be started, as in some browsers from file://.
async function decodedByWorker(task, progress) {
  if (!workersRun) return null;
  const url = URL.createObjectURL(new Blob(["'use strict';(" + decoder + ')().serveDecoder()'], {type: 'text/javascript'}));
  let worker = null;
  try {
    worker = new Worker(url);
    return await new Promise((done, fail) => {
      worker.onerror = (event) => {
        event.preventDefault();
        workersRun = false;
        done(null);
      };
      worker.onmessage = ({data: {part, made, error, known}}) => {
        if (made) done(made);
        else if (error) fail(known ? new PageError(error) : new Error(error));
        else progress(part);
      };
      worker.postMessage(task);
    });
  } catch (error) {
    if (worker) throw error;
    workersRun = false;
    return null;
  } finally {
    worker?.terminate();
    URL.revokeObjectURL(url);
  }
}

// What only networks need waits outside the script's memory.
const asWords = async (blob) => new Uint32Array(await blob.arrayBuffer());
const asNumbers = async (blob) => new Int32Array(await blob.arrayBuffer());

// The splats that come first, which are there sooner; null if the page has none.
async function loadCoarse(header, graphics) {
  if (!(header.splats.coarse > 0)) return null;
  SplatScene.warm(header, graphics, [0, 1].includes(header.styles[0]?.strength ?? 0) ? 1 : 2);
  const made = await decodedField(header, false, () => {});
  return Object.assign(new SplatScene(header, made, graphics), {coarse: true});
}
