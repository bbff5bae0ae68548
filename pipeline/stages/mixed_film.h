// Films of a scene and its styles, whose weights may change from frame to frame.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/page/keyframes.h"

namespace regrade {

// Gives a scene and its styles one geometry and one basis, as MixFields needs them. `names`:
// of the styles, for messages; `folder`: of the scene. Throws Error(kInput) for a style of
// another reconstruction.
void MakeMixable(const std::string& folder, const std::vector<std::string>& names,
                 StoredField* source, std::vector<StoredField>* styles);

// A renderer of the mix, see EQ(style-mix), kept while the weights stay the same.
class MixRenderer {
 public:
  // The fields must outlive this object; `object_weights` may be null.
  MixRenderer(const RadianceField& source, const std::vector<StoredField>& styles,
              const std::vector<float>* object_weights, Backend backend);
  const FieldRenderer& With(const std::vector<double>& weights);

 private:
  const RadianceField& source_;
  std::vector<const RadianceField*> styles_;
  const std::vector<float>* object_weights_;
  Backend backend_;
  std::vector<double> weights_;
  std::unique_ptr<FieldRenderer> renderer_;
};

struct PathFilm {
  int width = 0, height = 0;  // pixels
  int frames = 0;
  double fps = 30;
  std::vector<std::string> styles;  // names of those that the path weighs
};

// Size and frames of the film of a page's path in an output folder: the longer side is
// `longest` pixels, the shape that of the first keyframe, both even. Throws Error(kInput) for
// a path of less than two keyframes or a style that the folder does not have.
PathFilm PlanPathFilm(const std::string& folder, const KeyframePath& path, int longest,
                      double fps);

// Renders it exactly and writes it as MP4; whole styles, without the strength they were made
// with: the path has their weights. Throws what its parts throw.
void WritePathFilm(const std::string& folder, const KeyframePath& path, const PathFilm& film,
                   Backend backend, const std::string& file, const ProgressFunction& progress);

}  // namespace regrade
