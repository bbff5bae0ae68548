// Training steps whose weights are updated on the host, whichever processor computes the loss.
#pragma once

#include "stylize/training/style_engine.h"

namespace regrade {

class HostSteps {
 public:
  // See StyleEngine::Step.
  StepResult Make(const WeightUpdate& update, const StepRequest& request, StyleLoss* loss,
                  LipschitzNetwork* network, AdamState* adam);

 private:
  int rejected_in_a_row_ = 0;
};

}  // namespace regrade
