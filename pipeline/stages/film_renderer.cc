#include "pipeline/stages/film_renderer.h"

namespace regrade {

std::string WhyExactFilm(const RunSettings& settings, Backend backend, bool film_of_views) {
  if (settings.render.exact) return "--exact";
  if (settings.run.reproducible) return "--reproducible";
  if (backend == Backend::kCpu) return "the CPU has no fast renderer";
  if (film_of_views) return "its frames are those of the views";
  return "";
}

std::string PrepareFilm(const RunSettings& settings, Backend backend, bool film_of_views,
                        FieldRenderer* source, FieldRenderer* styled) {
  std::string why = WhyExactFilm(settings, backend, film_of_views);
  if (why.empty()) why = source->PrepareFast();
  if (why.empty()) why = styled->PrepareFast();
  if (!why.empty()) source->ForgetFast();
  return why;
}

std::string FilmRendererText(const std::string& why_exact) {
  return why_exact.empty() ? kFastRenderer : "exact (" + why_exact + ")";
}

}  // namespace regrade
