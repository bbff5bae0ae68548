// The sliding edge between the two headline pictures. The page is whole without it.
document.documentElement.className = 'js';
document.addEventListener('input', function (event) {
  var compare = event.target.closest('.compare');
  if (compare) compare.style.setProperty('--cut', event.target.value + '%');
});
