// Plots of the report page: what is drawn where, and what is left out.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pipeline/report/camera_map.h"
#include "pipeline/report/plot.h"

namespace regrade {
namespace {

size_t HowMany(const std::string& text, const std::string& what) {
  size_t count = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
    ++count;
  return count;
}

Plot PlotOf(std::vector<PlotPoint> points) {
  Plot plot;
  plot.series = {{"one", std::move(points), 1}};
  return plot;
}

TEST(ReportPlot, ALineLiesWhereItsNumbersAre) {
  // Linear axes span whole steps: x as given, y from 0 to 10.
  const std::string html = PlotHtml(PlotOf({{0, 0.0, ""}, {100, 10.0, ""}}));
  EXPECT_NE(html.find("points=\"40.0,212.0 548.0,24.0 \""), std::string::npos) << html;
  EXPECT_EQ(HowMany(html, "<text"), 6u + 6u + 2u);  // ticks and names of both axes
}

TEST(ReportPlot, PointsOfALineShowTheirNumbersUnderThePointer) {
  const std::string html = PlotHtml(PlotOf({{0, 0.0, ""}, {100, 10.0, ""}}));
  EXPECT_NE(html.find("<title>one, 100: 10.00</title>"), std::string::npos) << html;
}

TEST(ReportPlot, LogarithmicAxesHavePowersForTicks) {
  Plot plot = PlotOf({{1, 1.0, ""}, {2, 8.0, ""}, {3, -1.0, ""}, {4, 2.0, ""}});
  plot.log_y = true;
  const std::string html = PlotHtml(plot);
  for (const char* tick : {">1<", ">2<", ">4<", ">8<"})
    EXPECT_NE(html.find(tick), std::string::npos) << tick;
  EXPECT_EQ(HowMany(html, "<polyline"), 2u);  // a negative value breaks the line
}

TEST(ReportPlot, WhatCannotBeDrawnIsLeftOut) {
  EXPECT_EQ(PlotHtml({}), "");
  EXPECT_EQ(PlotHtml(PlotOf({{0, 1.0, ""}})), "");
  EXPECT_EQ(PlotHtml(PlotOf({{0, std::nullopt, ""}, {1, std::nullopt, ""}})), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string html =
      PlotHtml(PlotOf({{0, 1.0, ""}, {nan, 2.0, ""}, {2, nan, ""}, {3, 1.0, ""}}));
  EXPECT_EQ(html.find("nan"), std::string::npos) << html;
  EXPECT_EQ(HowMany(html, "<polyline"), 2u);
}

TEST(ReportPlot, DotsCarryTheirLabels) {
  Plot plot = PlotOf({{1, 2.0, "<b>--fit-steps 300</b>"}, {2, 3.0, "plain"}});
  plot.series[0].dots = true;
  const std::string html = PlotHtml(plot);
  EXPECT_EQ(HowMany(html, "<circle"), 2u);
  EXPECT_EQ(HowMany(html, "<b>"), 0u);
  EXPECT_NE(html.find("<title>&lt;b&gt;--fit-steps 300"), std::string::npos);
}

// Three cameras in a row that look along +z, y down.
Capture Row() {
  Capture capture;
  for (int i = 0; i < 3; ++i) {
    CaptureView view;
    view.file = "photo " + std::to_string(i);
    view.camera.width = view.camera.fx = 100;
    view.camera.camera_from_world.translation = {-1.0 * i, 0, 0};
    capture.views.push_back(view);
  }
  for (int i = 0; i < 5000; ++i) capture.points.push_back({{0.001 * i, 0.5, 4}, {}, 0, {}});
  return capture;
}

TEST(CameraMap, IsSeenFromAbove) {
  const CameraMap map = MapCameras(Row(), 2);
  ASSERT_EQ(map.cameras.size(), 3u);
  EXPECT_TRUE(map.cameras[0].held_out);
  EXPECT_FALSE(map.cameras[1].held_out);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(map.cameras[i].x, i, 1e-12);  // to the right, not mirrored
    EXPECT_NEAR(map.cameras[i].y, 0, 1e-12);
    EXPECT_NEAR(map.cameras[i].look_y, 1, 1e-12);
  }
  EXPECT_LE(map.points.size(), 1500u);
  EXPECT_NEAR(map.points[0].second, 4, 1e-12);  // ahead is up the page
}

TEST(CameraMap, CamerasWithoutACommonUpVectorHaveAMap) {
  Capture capture = Row();
  capture.views.resize(2);
  // Upside down and looking back: the means of up and of viewing directions vanish.
  capture.views[1].camera.camera_from_world.rotation =
      Mat3d{{Vec3d{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
  const std::string html = CameraMapHtml(MapCameras(capture, 0));
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_EQ(HowMany(html, "<circle"), 2u);
}

TEST(CameraMap, OneCameraAndNone) {
  Capture capture = Row();
  capture.views.resize(1);
  capture.points.clear();
  EXPECT_EQ(HowMany(CameraMapHtml(MapCameras(capture, 8)), "<circle"), 1u);
  EXPECT_EQ(CameraMapHtml(MapCameras(Capture(), 8)), "");
}

}  // namespace
}  // namespace regrade
