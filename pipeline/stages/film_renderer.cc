#include "pipeline/stages/film_renderer.h"

namespace regrade {

std::string WhyExactFilm(const RunSettings& settings, bool film_of_views) {
  if (settings.render.exact) return "--exact";
  if (settings.run.reproducible) return "--reproducible";
  if (film_of_views) return "its frames are those of the views";
  return "";
}

std::string PrepareFilm(const RunSettings& settings, bool film_of_views, FieldRenderer* source,
                        FieldRenderer* styled) {
  std::string why = WhyExactFilm(settings, film_of_views);
  if (why.empty()) why = source->PrepareFast();
  if (why.empty()) why = styled->PrepareFast();
  if (!why.empty()) source->ForgetFast();
  return why;
}

std::string FilmRendererText(const std::string& why_exact, const FieldRenderer& renderer) {
  return why_exact.empty() ? renderer.FastText() : "exact (" + why_exact + ")";
}

}  // namespace regrade
