#include "pipeline/stages/mixed_film.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/field/blend_fields.h"

namespace regrade {
namespace {

// Whether any keyframe shows style `i`.
bool IsShown(const KeyframePath& path, size_t i) {
  return std::ranges::any_of(path.keyframes,
                             [i](const Keyframe& key) { return key.weights[i] > 0; });
}

int EvenSide(double pixels) { return std::max(2, 2 * static_cast<int>(pixels / 2)); }

}  // namespace

void MakeMixable(const std::string& folder, const std::vector<std::string>& names,
                 StoredField* source, std::vector<StoredField>* styles) {
  int basis = source->field.appearance.basis;
  for (size_t i = 0; i < styles->size(); ++i) {
    RadianceField& field = (*styles)[i].field;
    if (!SameGeometry(*field.geometry, *source->field.geometry))
      throw InputError(
          "is a style of another reconstruction", names[i],
          "mixed styles must restyle the same field: make them with `regrade stylize " +
              folder + "`");
    field.geometry = source->field.geometry;
    basis = std::max(basis, field.appearance.basis);
  }
  // Styles of a field without view dependence may have some.
  const auto pad = [basis](RadianceField* field) {
    field->appearance = PadShBasis(std::move(field->appearance), basis);
  };
  pad(&source->field);
  for (StoredField& style : *styles) pad(&style.field);
}

MixRenderer::MixRenderer(const RadianceField& source, const std::vector<StoredField>& styles,
                         const std::vector<float>* object_weights, Backend backend)
    : source_(source), object_weights_(object_weights), backend_(backend) {
  for (const StoredField& style : styles) styles_.push_back(&style.field);
}

const FieldRenderer& MixRenderer::With(const std::vector<double>& weights) {
  if (!renderer_ || weights != weights_) {
    renderer_.reset();  // first: a field may need most of the memory
    renderer_ = std::make_unique<FieldRenderer>(
        MixFields(source_, styles_, weights, object_weights_), backend_);
    weights_ = weights;
  }
  return *renderer_;
}

PathFilm PlanPathFilm(const std::string& folder, const KeyframePath& path, int longest,
                      double fps) {
  if (path.keyframes.size() < 2)
    throw InputError("this camera path has one place", folder,
                     "add places in the page: a film leads from one to the next");
  PathFilm film;
  film.fps = fps;
  film.frames = FilmFrames(path.Seconds(), fps);
  const double *half = path.keyframes[0].half, larger = std::max(half[0], half[1]);
  film.width = EvenSide(longest * half[0] / larger);
  film.height = EvenSide(longest * half[1] / larger);
  std::map<std::string, std::string> names;
  for (const std::string& name : LearnedStyles(folder))
    names.emplace(PageStyleId(StyleFolder(folder, name)), name);
  for (size_t i = 0; i < path.styles.size(); ++i) {
    const auto found = names.find(path.styles[i]);
    if (found != names.end()) {
      film.styles.push_back(found->second);
    } else {
      if (IsShown(path, i))
        throw InputError(Concat("style ", i + 1, " of this camera path is not in the folder"),
                         folder,
                         "name the folder that the page was made of, or make the page and the "
                         "path again");
      film.styles.emplace_back();
    }
  }
  return film;
}

void WritePathFilm(const std::string& folder, const KeyframePath& path, const PathFilm& film,
                   Backend backend, const std::string& file, const ProgressFunction& progress) {
  std::vector<std::string> names;
  std::vector<size_t> shown;
  for (size_t i = 0; i < path.styles.size(); ++i) {
    if (!IsShown(path, i)) continue;
    shown.push_back(i);
    names.push_back(film.styles[i]);
  }
  CheckResults(folder, names);
  const std::string field = folder + "/field.npz";
  StoredField geometry = ReadFieldGeometry(field);
  std::vector<Camera> cameras;
  for (int i = 0; i < film.frames; ++i)
    cameras.push_back(CameraOfKeyframe(path.At(path.Seconds() * i / (film.frames - 1)),
                                       film.width, film.height, geometry.ndc));
  StoredField source = SeenPart(std::move(geometry), field, cameras);
  std::vector<StoredField> styles;
  for (const std::string& name : names)
    styles.push_back(StyledFieldOf(source, StyleFolder(folder, name), 1));
  MakeMixable(folder, names, &source, &styles);
  MixRenderer renderer(source.field, styles, nullptr, backend);
  VideoWriter writer(file, film.width, film.height, film.fps);
  for (int i = 0; i < film.frames; ++i) {
    ReportOrThrow(progress, i, film.frames);
    const Keyframe key = path.At(path.Seconds() * i / (film.frames - 1));
    std::vector<double> weights;
    for (const size_t k : shown) weights.push_back(key.weights[k]);
    writer.Add(renderer.With(weights).Render(cameras[static_cast<size_t>(i)]).color);
  }
  writer.Finish();
}

}  // namespace regrade
