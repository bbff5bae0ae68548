// The exact truth of an edit of the synthetic still life: its grade applied to unedited
// renders.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade::testing {

struct EditErrors {
  double inside = 0;   // mean squared error inside the edited region
  double outside = 0;  // mean absolute error 10 pixels and more from it; 0 where nothing is
};

class EditTruth {
 public:
  // `grade` as of `regrade synth --grade`; `renders` of the views of `regrade synth` in order;
  // `edited` is the view that was edited, which does not count.
  EditTruth(const std::string& grade, std::vector<Image> renders, int edited);

  const std::vector<Image>& renders() const { return renders_; }
  const std::vector<Image>& graded() const { return graded_; }

  // Of a picture for each view.
  EditErrors ErrorsOf(const std::vector<Image>& pictures) const;
  // The linear map of colours that is nearest to the truth in the views that count.
  std::vector<Image> ByLinearMap() const;

 private:
  int edited_;
  std::vector<Image> renders_, graded_;
  std::vector<std::vector<int>> parts_;  // 1 inside, 2 outside, 0 between
};

}  // namespace regrade::testing
