#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "scan_files.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::HasSubstr;

/// Scans made by others. Skipped, saying so, where they are not there.
class RealScans : public ::testing::Test {
 protected:
  void SetUp() override {
    if (real_data().empty()) GTEST_SKIP() << "no real scans: set TUBETRACK_TEST_DATA to their folder";
  }

  static Scan timed_scan(const std::string& name, const ScanOptions& options = {}) {
    const auto begin = std::chrono::steady_clock::now();
    Scan scan = scan_of(real_data() / name, options);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    std::printf("%s: %zu points, %zu faces, step %.3f mm, %.2f s\n", name.c_str(), scan.points_m.size(),
                scan.faces.size(), 1000.0 * scan.grid_step_m, seconds.count());
    for (const std::string& note : scan.notes) std::printf("  %s\n", note.c_str());
    return scan;
  }
};

/// How sharply the surfels' lines meet `radius_m` along their normals: the largest part of all lines in one cell.
double sharpest_meeting(const std::vector<ScanSurfel>& surfels, double radius_m, double cell_m) {
  std::vector<std::array<int, 3>> cells;
  for (const ScanSurfel& surfel : surfels) {
    const Eigen::Vector3f at =
        (surfel.position_m + static_cast<float>(radius_m) * surfel.inward_normal) / static_cast<float>(cell_m);
    cells.push_back({static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())),
                     static_cast<int>(std::floor(at.z()))});
  }
  std::sort(cells.begin(), cells.end());
  std::size_t most = 0;
  for (std::size_t begin = 0, end = 0; begin < cells.size(); begin = end) {
    while (end < cells.size() && cells[end] == cells[begin]) ++end;
    most = std::max(most, end - begin);
  }
  return static_cast<double>(most);
}

TEST_F(RealScans, TubeSectionLooksInwardToItsAxis) {
  const Scan scan = timed_scan("meshes/tube-section-scan.off");
  EXPECT_EQ(scan.faces.size(), 28438U);
  const auto surfels = surfels_of(scan);
  auto outward = surfels;
  for (ScanSurfel& surfel : outward) surfel.inward_normal = -surfel.inward_normal;
  // Its radius is 6 mm, as in the paper's figure.
  const double in = sharpest_meeting(surfels, 0.006, 0.001), out = sharpest_meeting(outward, 0.006, 0.001);
  std::printf("  lines that meet in one cell of 1 mm: %.0f inward, %.0f outward\n", in, out);
  EXPECT_GT(in, 5.0 * out);
}

TEST_F(RealScans, TrefoilIsJoinedButForItsSeamAndLooksInward) {
  const Scan scan = timed_scan("meshes/trefoil-tube.off");
  EXPECT_EQ(scan.faces.size(), 640U);
  EXPECT_EQ(scan.points_m.size(), 328U);
  // All but closed, so its volume has a sign.
  double volume = 0.0;
  for (const auto& [a, b, c] : scan.faces) volume += scan.points_m[a].dot(scan.points_m[b].cross(scan.points_m[c]));
  EXPECT_GT(volume, 0.0);
}

TEST_F(RealScans, AortaIsTheSameFromBothFormats) {
  for (const std::string name : {"aorta-ct/aorta_true_lumen", "aorta-ct/pulmonary_artery"}) {
    ScanOptions options;
    options.cell_size_m = 0.0015;
    const Scan nifti = timed_scan(name + ".nii.gz"), vol = timed_scan(name + ".vol", options);
    EXPECT_NEAR(nifti.grid_step_m, 0.0015, 1e-8);
    EXPECT_EQ(nifti.voxels.inside, vol.voxels.inside);
    const auto begin = std::chrono::steady_clock::now();
    const auto surfels = surfels_of(nifti);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    double area_m2 = 0.0;
    for (const ScanSurfel& surfel : surfels) area_m2 += surfel.weight * nifti.grid_step_m * nifti.grid_step_m;
    std::printf("  %zu surfels in %.2f s, area %.0f cm2\n", surfels.size(), seconds.count(), 1e4 * area_m2);
    EXPECT_GT(surfels.size(), 5000U);
  }
}

TEST_F(RealScans, LamppostAndMugCloudsAreInMetres) {
  EXPECT_THAT(timed_scan("clouds/lamppost.pcd").notes, ::testing::Contains(HasSubstr("give --unit")));
  ScanOptions metres;
  metres.unit = ScanUnit::metre;
  const Scan post = timed_scan("clouds/lamppost.pcd", metres);
  EXPECT_GT(post.points_m.size(), 1700U);
  const Scan mug = timed_scan("clouds/table_scene_mug_stereo_textured.pcd", metres);
  EXPECT_GT(mug.points_m.size(), 50'000U);
  // A sensor's frame: everything is seen from the origin.
  for (const ScanSurfel& surfel : surfels_of(mug)) ASSERT_GE(surfel.inward_normal.dot(surfel.position_m), -1e-4F);
}

}  // namespace
}  // namespace tubetrack
