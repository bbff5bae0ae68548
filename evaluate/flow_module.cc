#include "evaluate/flow_module.h"

#include <opencv2/optflow.hpp>

void RegradeContributedFlow(const std::string& name, void* method) {
  auto& result = *static_cast<cv::Ptr<cv::DenseOpticalFlow>*>(method);
  if (name == "deepflow")
    result = cv::optflow::createOptFlow_DeepFlow();
  else if (name == "tvl1")
    result = cv::optflow::createOptFlow_DualTVL1();
  else if (name == "pca-flow")
    result = cv::optflow::createOptFlow_PCAFlow();
  else
    result = cv::optflow::createOptFlow_DenseRLOF();
}
