#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "scan_files.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using std::numbers::pi;

std::string mhd_text(const std::string& extra, const std::string& data) {
  return "ObjectType = Image\nNDims = 3\nBinaryData = True\n" + extra +
         "DimSize = 40 40 12\nElementDataFile = " + data + "\n";
}

std::string vol_bytes(int size_xy, int size_z, const std::string& voxels, const std::string& version = "2") {
  const std::string size = std::to_string(size_xy);
  return "Center-X: 0\nCenter-Y: 0\nCenter-Z: 0\nX: " + size + "\nY: " + size + "\nZ: " + std::to_string(size_z) +
         "\nVoxel-Size: 1\nInt-Endian: 0123\nVoxel-Endian: 0\nAlpha-Color: 0\nVersion: " + version + "\n.\n" + voxels;
}

TEST(VolumeScan, EveryFormatGivesTheSameVoxels) {
  const TemporaryFolder folder;
  const std::string voxels = torus_voxels(40, 12, 13.0, 4.0);
  std::string shorts;
  for (const char c : voxels) shorts += c != 0 ? std::string("\x01\x2c", 2) : std::string(2, '\0');  // 300, big endian
  write_bytes(folder / "a.vol", vol_bytes(40, 12, voxels));
  write_bytes(folder / "packed.vol", vol_bytes(40, 12, deflated(voxels, false), "3"));
  write_bytes(folder / "a.nii", nifti_bytes({40, 40, 12}, {1, 1, 1}, voxels));
  write_bytes(folder / "a.nii.gz", deflated(nifti_bytes({40, 40, 12}, {1, 1, 1}, voxels), true));
  const std::string half = voxels.substr(0, 5000);
  write_bytes(folder / "two.nii.gz",
              deflated(nifti_bytes({40, 40, 12}, {1, 1, 1}, half), true) + deflated(voxels.substr(5000), true));
  write_bytes(folder / "a.raw", voxels);
  write_bytes(folder / "a.mhd", mhd_text("ElementType = MET_UCHAR\nElementSpacing = 1 1 1\n", "a.raw"));
  write_bytes(folder / "a.zraw", deflated(shorts, false));
  write_bytes(folder / "packed.mhd", mhd_text("ElementType = MET_SHORT\nElementSpacing = 1 1 1\nCompressedData = True\n"
                                              "BinaryDataByteOrderMSB = True\n",
                                              "a.zraw"));
  write_bytes(folder / "a.mha", mhd_text("ElementType = MET_UCHAR\nElementSpacing = 1 1 1\n", "LOCAL") + voxels);
  for (const char* name : {"a.vol", "packed.vol", "a.nii", "a.nii.gz", "two.nii.gz", "a.mhd", "packed.mhd", "a.mha"}) {
    SCOPED_TRACE(name);
    const Scan scan = scan_of(folder / name);
    EXPECT_EQ(scan.kind, ScanKind::voxels);
    ASSERT_EQ(scan.voxels.inside.size(), voxels.size());
    for (std::size_t i = 0; i < voxels.size(); ++i) ASSERT_EQ(scan.voxels.inside[i], voxels[i] != 0 ? 1 : 0);
    EXPECT_TRUE(scan.voxels.axes_m.isApprox(0.001 * Eigen::Matrix3d::Identity(), 1e-6));
    EXPECT_NEAR(scan.grid_step_m, 0.001, 1e-9);
  }
}

/// A gzip file made longer: by a name in its header.
std::string padded(std::string gzip, std::size_t bytes) {
  constexpr std::size_t kHeader_bytes = 10;
  gzip[3] = static_cast<char>(gzip[3] | 8);  // it has a name
  return gzip.insert(kHeader_bytes, std::string(bytes - gzip.size() - 1, 'x') + '\0');
}

// Read in blocks of 64 KB: what follows a member may be in the next.
TEST(VolumeScan, AGzipFileMayBeSeveralWhereverTheyMeet) {
  const TemporaryFolder folder;
  const std::string voxels = torus_voxels(40, 12, 13.0, 4.0);
  const std::string first = deflated(nifti_bytes({40, 40, 12}, {1, 1, 1}, voxels.substr(0, 5000)), true);
  for (const std::size_t bytes : {65533U, 65534U, 65535U, 65536U, 65537U}) {
    write_bytes(folder / "a.nii.gz", padded(first, bytes) + deflated(voxels.substr(5000), true));
    const auto inside = scan_of(folder / "a.nii.gz").voxels.inside;
    EXPECT_TRUE(std::ranges::equal(inside, voxels, {}, {}, [](char c) { return c != 0 ? 1 : 0; })) << bytes;
  }
}

TEST(VolumeScan, SpacingIsTheHeadersUnlessTold) {
  const TemporaryFolder folder;
  const std::string voxels = torus_voxels(40, 12, 13.0, 4.0);
  write_bytes(folder / "a.nii", nifti_bytes({40, 40, 12}, {0.5, 0.5, 2.0}, voxels));
  ScanOptions options;
  const Scan scan = scan_of(folder / "a.nii", options);
  EXPECT_NEAR(scan.voxels.axes_m(2, 2), 0.002, 1e-9);
  EXPECT_NEAR(scan.grid_step_m, 0.001 * std::cbrt(0.5), 1e-9);
  options.unit = ScanUnit::metre;
  EXPECT_NEAR(scan_of(folder / "a.nii", options).voxels.axes_m(2, 2), 2.0, 1e-6);
  options.unit = ScanUnit::voxel;
  EXPECT_NEAR(scan_of(folder / "a.nii", options).voxels.axes_m(2, 2), 0.001, 1e-9);
  options = {};
  options.cell_size_m = 0.003;
  EXPECT_NEAR(scan_of(folder / "a.nii", options).grid_step_m, 0.003, 1e-9);

  write_bytes(folder / "a.vol", vol_bytes(40, 12, voxels));
  EXPECT_THAT(scan_of(folder / "a.vol").notes, Contains(HasSubstr("1 mm assumed; if that is wrong, give --cell-size")));
  EXPECT_THAT(scan_of(folder / "a.vol", options).notes, IsEmpty());
}

TEST(VolumeScan, AxesAndOffsetPlaceTheVoxels) {
  const TemporaryFolder folder;
  const std::string voxels = torus_voxels(40, 12, 13.0, 4.0);
  write_bytes(folder / "a.raw", voxels);
  write_bytes(folder / "a.mhd", mhd_text("ElementType = MET_UCHAR\nElementSpacing = 1 2 3\nOffset = 10 20 30\n"
                                         "TransformMatrix = 0 1 0 -1 0 0 0 0 1\n",
                                         "a.raw"));
  const VoxelGrid grid = scan_of(folder / "a.mhd").voxels;
  EXPECT_LT((grid.axes_m.col(0) - Eigen::Vector3d(0, 0.001, 0)).norm(), 1e-12);
  EXPECT_LT((grid.axes_m.col(1) - Eigen::Vector3d(-0.002, 0, 0)).norm(), 1e-12);
  EXPECT_LT((grid.origin_m - Eigen::Vector3d(0.010, 0.020, 0.030)).norm(), 1e-12);
}

TEST(VolumeScan, LabelsAndThresholdsTellTheBody) {
  const TemporaryFolder folder;
  std::string voxels(8 * 8 * 8, '\0');
  voxels[100] = '\x02';
  voxels[200] = voxels[201] = '\x05';
  write_bytes(folder / "a.nii", nifti_bytes({8, 8, 8}, {1, 1, 1}, voxels));
  const auto count = [&](const ScanOptions& options) {
    const auto inside = scan_of(folder / "a.nii", options).voxels.inside;
    return std::accumulate(inside.begin(), inside.end(), 0);
  };
  ScanOptions label, threshold, both;
  label.label = 2;
  threshold.threshold = 2;
  EXPECT_EQ(count(label), 1);
  EXPECT_EQ(count(threshold), 3);
  EXPECT_THAT(refusal_of(folder / "a.nii"), HasSubstr("values 2, 5 and maybe more (0 to 5); give --label N"));
  label.label = 3;
  EXPECT_THAT(refusal_of(folder / "a.nii", label), HasSubstr("no voxel is in the body by --label 3"));
  threshold.threshold = 0;
  EXPECT_THAT(refusal_of(folder / "a.nii", threshold), HasSubstr("every voxel is in the body by --threshold 0"));
  both.label = both.threshold = 1;
  EXPECT_THAT(refusal_of(folder / "a.nii", both), HasSubstr("takes one of them"));
}

struct DigitalErrors {
  double mean_deg = 0.0, worst_deg = 0.0, area_ratio = 0.0;
};
/// A torus of R 60, r 12 mm, digitised with a step.
DigitalErrors digital_torus(const std::filesystem::path& path, double step_mm, double radius_in_steps,
                            GridNormals method = GridNormals::smoothed) {
  const TorusPiece piece{60.0, 12.0};
  const int size_xy = 2 * static_cast<int>(76.0 / step_mm), size_z = 2 * static_cast<int>(16.0 / step_mm);
  write_bytes(path, vol_bytes(size_xy, size_z, torus_voxels(size_xy, size_z, 60.0 / step_mm, 12.0 / step_mm)));
  ScanOptions options;
  options.cell_size_m = 0.001 * step_mm;
  ScanSurfelOptions surfel_options;
  surfel_options.normal_radius_m = radius_in_steps * 0.001 * step_mm;
  surfel_options.normals = method;
  const Scan scan = scan_of(path, options);
  const auto surfels = surfels_of(scan, surfel_options);
  const Eigen::Vector3d center_mm = 0.5 * step_mm * Eigen::Vector3d(size_xy - 1, size_xy - 1, size_z - 1);
  DigitalErrors errors;
  for (const ScanSurfel& surfel : surfels) {
    const Eigen::Vector3d normal = torus_normal(piece, 1000.0 * surfel.position_m.cast<double>() - center_mm);
    const double deg = std::acos(std::clamp(-surfel.inward_normal.cast<double>().dot(normal), -1.0, 1.0)) * 180 / pi;
    errors.mean_deg += deg / static_cast<double>(surfels.size());
    errors.worst_deg = std::max(errors.worst_deg, deg);
    errors.area_ratio += surfel.weight * step_mm * step_mm / (4 * pi * pi * 60.0 * 12.0);
  }
  return errors;
}

TEST(VolumeScan, NormalsOfADigitisedTorusGetBetterWithTheGrid) {
  const TemporaryFolder folder;
  double last_deg = 180.0;
  for (const double step_mm : {3.0, 2.0, 1.0, 0.5}) {
    for (const double radius : {2.0, 3.0, 4.0, 6.0}) {
      const DigitalErrors errors = digital_torus(folder / "a.vol", step_mm, radius);
      std::printf("torus 60/12 mm, step %.1f mm, ball of %.0f steps: normals %.2f deg mean, %.1f worst, area %.3f\n",
                  step_mm, radius, errors.mean_deg, errors.worst_deg, errors.area_ratio);
      if (radius != 4.0) continue;
      EXPECT_LT(errors.mean_deg, last_deg);
      EXPECT_LT(errors.worst_deg, 8.0);
      EXPECT_NEAR(errors.area_ratio, 1.0, 0.01);
      last_deg = errors.mean_deg;
    }
  }
  EXPECT_LT(last_deg, 1.3);
}

TEST(VolumeScan, TheVoronoiMeasureConvergesToo) {
  const TemporaryFolder folder;
  for (const auto& [step_mm, mean_deg] : {std::pair(2.0, 2.4), std::pair(1.0, 1.2), std::pair(0.5, 0.85)}) {
    const DigitalErrors errors = digital_torus(folder / "a.vol", step_mm, 4.0, GridNormals::voronoi);
    EXPECT_LT(errors.mean_deg, mean_deg);
    EXPECT_LT(errors.worst_deg, 8.0);
    EXPECT_NEAR(errors.area_ratio, 1.0, 0.01);
  }
}

TEST(VolumeScan, AMirroredGridHasItsNormalsRight) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.raw", torus_voxels(40, 12, 13.0, 4.0));
  write_bytes(folder / "a.mhd", mhd_text("ElementType = MET_UCHAR\nElementSpacing = 1 1 1\n"
                                         "TransformMatrix = -1 0 0 0 1 0 0 0 1\n",
                                         "a.raw"));
  const Eigen::Vector3d center_mm(-19.5, 19.5, 5.5);
  for (const GridNormals method : {GridNormals::smoothed, GridNormals::voronoi}) {
    ScanSurfelOptions options;
    options.normals = method;
    for (const ScanSurfel& surfel : surfels_of(scan_of(folder / "a.mhd"), options)) {
      const Eigen::Vector3d normal = torus_normal({13.0, 4.0}, 1000.0 * surfel.position_m.cast<double>() - center_mm);
      ASSERT_LT(surfel.inward_normal.cast<double>().dot(normal), -0.7);
    }
  }
}

TEST(VolumeScan, TheGridsBorderIsNoSurface) {
  const TemporaryFolder folder;
  std::string voxels;  // a bar that runs through the volume
  for (int i = 0; i < 10 * 10 * 10; ++i) voxels += std::hypot(i % 10 - 4.5, i / 10 % 10 - 4.5) < 3.2 ? '\x01' : '\0';
  write_bytes(folder / "a.nii", nifti_bytes({10, 10, 10}, {1, 1, 1}, voxels));
  for (const ScanSurfel& surfel : surfels_of(scan_of(folder / "a.nii")))
    ASSERT_LT(std::abs(surfel.inward_normal.z()), 0.3F);
}

/// A half-round bar along the columns' axis on a base, in counts of 0.01 mm, cells of 0.5 mm.
cv::Mat bar_heights() {
  cv::Mat heights(60, 120, CV_16UC1);
  for (int v = 0; v < heights.rows; ++v) {
    const double y = 0.5 * (v - 30);
    const double top = std::abs(y) < 8.0 ? std::sqrt(64.0 - y * y) : 0.0;
    for (int u = 0; u < heights.cols; ++u)
      heights.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(500 + 100 * top);
  }
  heights.at<std::uint16_t>(30, 60) = 0;
  return heights;
}

TEST(HeightMapScan, NormalsPointToTheAxis) {
  const TemporaryFolder folder;
  ScanOptions options;
  options.cell_size_m = 0.0005;
  options.height_scale_m = 0.00001;
  const std::tuple<const char*, GridNormals, int, double> cases[] = {{"a.png", GridNormals::smoothed, 2500, 1.5},
                                                                     {"a.pgm", GridNormals::smoothed, 2500, 1.5},
                                                                     {"a.tiff", GridNormals::smoothed, 2500, 1.5},
                                                                     {"v.png", GridNormals::voronoi, 2500, 1.5}};
  for (const auto& [name, method, least, most_deg] : cases) {
    SCOPED_TRACE(name);
    ScanSurfelOptions surfel_options;
    surfel_options.normals = method;
    ASSERT_TRUE(cv::imwrite((folder / name).string(), bar_heights()));
    const Scan scan = scan_of(folder / name, options);
    EXPECT_EQ(scan.kind, ScanKind::height_map);
    EXPECT_EQ(scan.grid_step_m, 0.0005);
    int on_bar = 0;
    double sum_deg = 0.0;
    for (const ScanSurfel& surfel : surfels_of(scan, surfel_options)) {
      const Eigen::Vector2d to_axis(0.015 - surfel.position_m.y(), -0.005 - surfel.position_m.z());
      const Eigen::Vector2f from_hole = surfel.position_m.head<2>() - 0.0005F * Eigen::Vector2f(60.0F, 30.0F);
      ASSERT_GT(from_hole.norm(), 0.0002F);
      if (std::abs(to_axis.x()) > 0.006) continue;  // steeper than the grid shows
      ++on_bar;
      const Eigen::Vector3d axis_way(0.0, to_axis.x(), to_axis.y());
      ASSERT_NEAR(axis_way.norm(), 0.008, 0.0001);
      sum_deg += std::acos(std::min(1.0, surfel.inward_normal.cast<double>().dot(axis_way.normalized()))) * 180.0 / pi;
    }
    EXPECT_GT(on_bar, least);
    EXPECT_LT(sum_deg / on_bar, most_deg);
  }
}

TEST(HeightMapScan, AsksForWhatTheImageDoesNotSay) {
  const TemporaryFolder folder;
  ASSERT_TRUE(cv::imwrite((folder / "a.png").string(), bar_heights()));
  ScanOptions options;
  EXPECT_THAT(refusal_of(folder / "a.png", options), HasSubstr("--cell-size (edge of a pixel) and --height-scale"));
  options.cell_size_m = 0.0005;
  EXPECT_THAT(refusal_of(folder / "a.png", options), HasSubstr("a height map takes --height-scale"));
  options.height_scale_m = -1.0;
  EXPECT_THAT(refusal_of(folder / "a.png", options), HasSubstr("--height-scale -1: takes metres per count"));
  options.height_scale_m = 0.001;
  write_8bit(folder / "grey.png", 10, 10, 1);
  EXPECT_THAT(refusal_of(folder / "grey.png", options), HasSubstr("8-bit with 1 channel(s), takes 16-bit"));
}

}  // namespace
}  // namespace tubetrack
