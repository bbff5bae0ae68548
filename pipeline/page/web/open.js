// The first answer of `regrade view`: asks for the page with the token, until it is made, and becomes it.
(async () => {
  const message = document.getElementById('message');
  const headers = {Authorization: 'Bearer ' + location.hash.slice(1)};
  const ask = () => fetch('/page', {headers, cache: 'no-store', credentials: 'omit'}).catch(() => null);
  let answer = await ask();
  for (; answer?.status === 202; answer = await ask()) {
    message.textContent = (await answer.json()).awaited;
    await new Promise((done) => setTimeout(done, 500));
  }
  if (!answer) return void (message.textContent = 'regrade view has ended; its terminal says why.');
  if (!answer.ok) return void (message.textContent = 'Open the address that regrade view printed.');
  const text = await answer.text();
  document.open();
  document.write(text);
  document.close();
})();
