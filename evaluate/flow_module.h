// The methods of OpenCV's module optflow, in a module of ours that is loaded at the first use:
// it brings more than 100 libraries.
#pragma once

#include <string>

// "deepflow", "tvl1", "pca-flow" or "rlof"; `method` points to a
// cv::Ptr<cv::DenseOpticalFlow>.
extern "C" __attribute__((visibility("default"))) void RegradeContributedFlow(
    const std::string& name, void* method);
