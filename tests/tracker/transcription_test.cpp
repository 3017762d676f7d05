// The accumulation map and the trace against the paper's algorithms 1 and 2, transcribed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "paper_transcription.hpp"
#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/trace.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

constexpr double kDegrees = 180.0 / std::numbers::pi;

struct Case {
  Course course;
  double radius_m;
  double cell_m;
  double noise_deg;
  bool half;
  std::uint64_t seed;
};

void PrintTo(const Case& c, std::ostream* out) {
  const char* names[] = {"straight", "torus", "s_bend"};
  *out << fmt::format("{} R {:.1f} mm, cell {:.1f} mm, noise {}°, {}", names[static_cast<int>(c.course)],
                      1e3 * c.radius_m, 1e3 * c.cell_m, c.noise_deg, c.half ? "camera side" : "all around");
}

std::vector<Case> cases() {
  std::vector<Case> all;
  std::uint64_t seed = 1;
  for (const Course course : {Course::straight, Course::torus, Course::s_bend}) {
    for (const auto& [radius_m, cell_m] :
         {std::pair{0.008, 0.0015}, {0.0125, 0.002}, {0.020, 0.003}, {0.040, 0.0055}}) {
      for (const double noise_deg : {0.0, 1.0, 2.0, 3.0}) {
        for (const bool half : {false, true}) all.push_back({course, radius_m, cell_m, noise_deg, half, seed++});
      }
    }
  }
  return all;
}

/// Both maps from the same records.
struct Both {
  AccumulationMap map;
  paper::Images images;
  TraceOptions options;
  paper::TrackSettings settings;
  std::vector<AxisPoint> axis;
};

Both build(const Case& c) {
  std::mt19937_64 random(c.seed);
  SurfelScene scene;
  scene.spacing_m = 0.6 * c.cell_m;  // no voxel of the axis goes without votes
  scene.normal_noise_rad = c.noise_deg / kDegrees;
  scene.camera_side_only = c.half;
  const auto axis = course_points(c.course, c.radius_m, scene.spacing_m, random_pose(random));
  std::vector<VoteRecord> records;
  for (const Surfel& surfel : tube_surface(axis, c.radius_m, scene, random)) {
    records.push_back(vote_record(surfel, c.cell_m));
  }
  // A mesh has its faces in any order.
  std::shuffle(records.begin(), records.end(), random);
  Both both{AccumulationMap(c.cell_m), {}, {}, {}, axis};
  for (const VoteRecord& record : records) both.map.add(record);
  const double acc_radius_m = c.radius_m + scene.epsilon_m;
  const int margin = static_cast<int>(std::ceil(3.0 * acc_radius_m / c.cell_m));
  both.images = paper::accumulation_from_normal_vectors(records, margin);
  both.options.step_m = c.radius_m;
  both.options.patch_half_m = acc_radius_m;
  both.options.box_half = 0;
  both.settings = {c.cell_m, acc_radius_m, c.radius_m, {}};
  return both;
}

double angle_between_deg(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * kDegrees;
}

Vector3d tangent_at(const std::vector<AxisPoint>& axis, const Vector3d& point) {
  return std::ranges::min_element(axis, {}, [&](const AxisPoint& at) { return (at.position_m - point).norm(); })
      ->tangent;
}

/// Distance from the polyline, its ends drawn out by `beyond_m`.
double distance_m(const Vector3d& point, std::vector<Vector3d> line, double beyond_m) {
  line.front() += beyond_m * (line[0] - line[1]).normalized();
  line.back() += beyond_m * (line[line.size() - 1] - line[line.size() - 2]).normalized();
  double best = 1e9;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector3d along = line[i + 1] - line[i];
    const double s = std::clamp((point - line[i]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (point - line[i] - s * along).norm());
  }
  return best;
}

void same_records_give_the_same_count_in_every_voxel(const Both& both) {
  ASSERT_GT(both.images.acc_image.size(), 1000U);
  for (const auto& [at, votes] : both.images.acc_image) {
    ASSERT_EQ(both.map.at(at).votes, votes) << at.x << ' ' << at.y << ' ' << at.z;
    for (int i = 0; i < 27; ++i) {  // and no vote beside them
      const VoxelIndex beside{at.z + i / 9 - 1, at.y + i / 3 % 3 - 1, at.x + i % 3 - 1};
      ASSERT_EQ(both.map.at(beside).votes, both.images.acc(beside));
    }
  }
}

void the_best_peak_is_max_acc_at_max_pt(Both& both) {
  const auto peaks = both.map.peaks(1, 0);
  ASSERT_FALSE(peaks.empty());
  EXPECT_EQ(both.map.at(peaks.front()).votes, both.images.max_acc);
  EXPECT_EQ(peaks.front(), both.images.max_pt);
}

void axes_at_peaks_agree_within_2_degrees(Both& both, double noise_deg) {
  double worst_deg = 0.0;
  double squares = 0.0;
  double ours_squares = 0.0;
  double theirs_squares = 0.0;
  const auto peaks = both.map.peaks(both.images.max_acc / 2, 0);
  ASSERT_GE(peaks.size(), 3U);
  for (const VoxelIndex& peak : peaks) {
    const Vector3d ours = axis_of(both.map.at(peak)).direction;
    const Vector3d theirs = both.images.dir(peak);
    const double off_deg = angle_between_deg(ours, theirs);
    worst_deg = std::max(worst_deg, off_deg);
    squares += off_deg * off_deg;
    const Vector3d truth = tangent_at(both.axis, both.map.center_of(peak));
    ours_squares += std::pow(angle_between_deg(ours, truth), 2);
    theirs_squares += std::pow(angle_between_deg(theirs, truth), 2);
  }
  const auto n = static_cast<double>(peaks.size());
  EXPECT_LE(std::sqrt(squares / n), 1.0);
  // With 3° of noise in the normals a few of many peaks differ by more: that is dirImage's own noise.
  EXPECT_LE(worst_deg, noise_deg <= 2.0 ? 2.0 : 2.5) << peaks.size() << " peaks";
  EXPECT_LE(std::sqrt(ours_squares / n), 0.1 + 1.1 * std::sqrt(theirs_squares / n));
}

void with_our_axes_the_trace_is_the_same_voxel_for_voxel(Both& both) {
  both.settings.dir = [&](const VoxelIndex& at) { return axis_of(both.map.at(at)).direction; };
  for (const bool in_front : {true, false}) {
    auto expected = paper::track_patch_center(both.images, both.images.max_pt, in_front, both.settings);
    ASSERT_FALSE(expected.left_domain);
    expected.points.pop_back();  // ours leaves out the point that is no longer inside
    std::vector<VoxelIndex> traced;
    for (const TracePoint& point : trace_one_way(both.map, both.images.max_pt, in_front, both.options)) {
      EXPECT_EQ(point.votes, both.images.acc(point.voxel));
      traced.push_back(point.voxel);
    }
    EXPECT_EQ(traced, expected.points);
  }
}

void with_its_own_axes_the_trace_stays_within_2_voxels_of_ours(Both& both, const Case& c) {
  both.settings.dir = [&](const VoxelIndex& at) { return both.images.dir(at); };
  const auto ours = trace_both_ways(both.map, both.images.max_pt, both.options);
  std::vector<VoxelIndex> theirs;
  for (const bool in_front : {true, false}) {
    const auto line = paper::track_patch_center(both.images, both.images.max_pt, in_front, both.settings);
    theirs.insert(theirs.end(), line.points.begin(), line.points.end() - 1);
  }
  if (c.noise_deg == 0.0 && ours.size() < 3) {
    // All votes of an exact ring meet in one voxel, which the sampled patch can miss: both must end here.
    EXPECT_LE(theirs.size(), 4U);
    return;
  }
  ASSERT_GE(ours.size(), 3U);
  std::vector<Vector3d> line;
  line.reserve(ours.size());
  for (const TracePoint& point : ours) line.push_back(point.position_m);
  double worst_m = 0.0;
  for (const VoxelIndex& at : theirs) {
    worst_m = std::max(worst_m, distance_m(both.map.center_of(at), line, c.radius_m));
  }
  EXPECT_LE(worst_m, 2.0 * c.cell_m) << ours.size() << " points against " << theirs.size();
}

class Transcription : public ::testing::TestWithParam<Case> {};

// The maps of a case are what takes the time: one pair for all that is compared.
TEST_P(Transcription, AgreesInVotesPeaksAxesAndTraces) {
  Both both = build(GetParam());
  same_records_give_the_same_count_in_every_voxel(both);
  the_best_peak_is_max_acc_at_max_pt(both);
  axes_at_peaks_agree_within_2_degrees(both, GetParam().noise_deg);
  with_our_axes_the_trace_is_the_same_voxel_for_voxel(both);
  with_its_own_axes_the_trace_stays_within_2_voxels_of_ours(both, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Tubes, Transcription, ::testing::ValuesIn(cases()));

TEST(TranscriptionDomain, TheWholeSpaceIsTheSame) {
  const Both both = build({Course::s_bend, 0.020, 0.004, 2.0, true, 77});
  const VoxelIndex& lower = both.images.domain_lower;
  const VoxelIndex& upper = both.images.domain_upper;
  std::int64_t votes = 0;
  for (int z = lower.z; z <= upper.z; ++z) {
    for (int y = lower.y; y <= upper.y; ++y) {
      for (int x = lower.x; x <= upper.x; ++x) {
        ASSERT_EQ(both.map.at({z, y, x}).votes, both.images.acc({z, y, x}));
        votes += both.map.at({z, y, x}).votes;
      }
    }
  }
  EXPECT_GT(votes, 1000);
}

}  // namespace
}  // namespace tubetrack
