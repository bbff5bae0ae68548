// Which renderer makes the frames of a film: the fast one, unless there is a reason against it.
#pragma once

#include <string>

#include "kernels/render/field_renderer.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// What options decide, whatever the processor: the film is rendered as exactly as the views.
inline bool WantsExactFilm(const RunSettings& settings) {
  return settings.render.exact || settings.run.reproducible;
}

// Why the film's frames are rendered exactly; empty: by the fast renderer. The frames of
// `film_of_views` are those at the photos' positions, which are always exact.
std::string WhyExactFilm(const RunSettings& settings, bool film_of_views);

// The same, and prepares both renderers where it is empty: both, or neither.
std::string PrepareFilm(const RunSettings& settings, bool film_of_views, FieldRenderer* source,
                        FieldRenderer* styled);

// For the console and the report: the fast renderer, or "exact (REASON)".
std::string FilmRendererText(const std::string& why_exact, const FieldRenderer& renderer);

}  // namespace regrade
