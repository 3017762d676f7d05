// Depth frame to surfels, 640×480, on one core, beside a memcpy of the frame and a floor pass in the same run:
//   cmake --preset release -DTUBETRACK_BENCH=ON && cmake --build --preset release --target heightmap_bench
//   build/release/bin/heightmap_bench --benchmark_repetitions=9 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "floor_pass.hpp"
#include "tubetrack/heightmap/normals.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

const Intrinsics kCamera{640, 480, 570.0, 570.0, 319.5, 239.5, {}};
constexpr std::size_t kPixels = 640 * 480;

using Pixels = std::vector<std::uint16_t>;

DepthFrame frame_of(const Pixels& pixels) {
  return {pixels.data(), kCamera.width, kCamera.height, static_cast<std::size_t>(kCamera.width) * 2, 1e-4};
}

/// A tube of radius 20 mm, `aside_m` from the middle and 0.8 m away, 0.5 m before a leaning wall; with the sensor's
/// noise, and a share of the pixels beside the tube's edges without return.
Pixels scene(double aside_m, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const Vector3d center(aside_m, 0.0, 0.8);
  const Vector3d axis = Vector3d(0.3, 1.0, 0.1).normalized();
  const Vector3d center_across = center - center.dot(axis) * axis;
  Pixels pixels(kPixels);
  for (int v = 0; v < kCamera.height; ++v) {
    for (int u = 0; u < kCamera.width; ++u) {
      const Eigen::Vector2d ray2 = normalized_ray(kCamera, u, v);
      const Vector3d ray(ray2.x(), ray2.y(), 1.0);
      const Vector3d ray_across = ray - ray.dot(axis) * axis;
      const double a = ray_across.squaredNorm();
      const double b = ray_across.dot(center_across);
      const double discriminant = b * b - a * (center_across.squaredNorm() - 0.02 * 0.02);
      double z = discriminant > 0.0 ? (b - std::sqrt(discriminant)) / a : 1.3 / (1.0 + 0.2 * ray.x());
      z += axial_sigma_m({}, z, 0.0) * gauss(random);
      const bool beside = discriminant < 0.0 && discriminant > -6e-4;
      const bool none = beside && unit(random) < 0.5;
      pixels[static_cast<std::size_t>(v) * 640 + static_cast<std::size_t>(u)] =
          none ? 0 : static_cast<std::uint16_t>(std::lround(z / 1e-4));
    }
  }
  return pixels;
}

/// The same scene with other noise; or the tube going to and fro by 4 mm a frame.
std::vector<Pixels> recording(bool moving) {
  std::vector<Pixels> frames(16);
  for (unsigned i = 0; i < 16; ++i) frames[i] = scene(moving ? 0.004 * std::min(i, 16 - i) : 0.0, 1 + i);
  return frames;
}

const std::vector<Pixels>& still() {
  static const auto frames = recording(false);
  return frames;
}

const std::vector<Pixels>& moving() {
  static const auto frames = recording(true);
  return frames;
}

void Memcpy(benchmark::State& state) {
  Pixels to(kPixels);
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    std::memcpy(to.data(), still()[i++ % still().size()].data(), 2 * kPixels);
    benchmark::ClobberMemory();
  }
}

/// What any stage that looks at the pixels costs.
void Floor(benchmark::State& state) {
  bench::FloorPass pass;
  Workers one(1);
  std::size_t frame = 0;
  for ([[maybe_unused]] auto _ : state) {
    bench::floor_pass(frame_of(still()[frame++ % still().size()]), pass, one);
    benchmark::DoNotOptimize(pass.mean_m.data());
    benchmark::ClobberMemory();
  }
}

void Update(benchmark::State& state, const std::vector<Pixels>& frames, bool fuse) {
  HeightMap map = make_height_map(kCamera);
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) update(map, frame_of(frames[i++ % frames.size()]), {}, {}, fuse);
}

/// Frame to surfels; what is timed is the whole of it.
void Frame(benchmark::State& state, const std::vector<Pixels>& frames, bool fuse) {
  HeightMap map = make_height_map(kCamera);
  SurfelFinder finder;
  std::size_t i = 0;
  std::size_t surfels = 0;
  const auto one = [&] {
    update(map, frame_of(frames[i++ % frames.size()]), {}, {}, fuse);
    surfels = finder.find(map, {}, {}).size();
  };
  for (int warm_up = 0; warm_up < 64; ++warm_up) one();
  for ([[maybe_unused]] auto _ : state) one();
  state.counters["surfels"] = static_cast<double>(surfels);
}

void FirstFrame(benchmark::State& state) {
  for ([[maybe_unused]] auto _ : state) {
    state.PauseTiming();
    HeightMap map = make_height_map(kCamera);
    SurfelFinder finder;
    state.ResumeTiming();
    update(map, frame_of(still()[0]), {}, {}, true);
    benchmark::DoNotOptimize(finder.find(map, {}, {}).data());
    state.PauseTiming();
    finder = SurfelFinder();
    state.ResumeTiming();
  }
}

BENCHMARK(Memcpy)->Unit(benchmark::kMillisecond);
BENCHMARK(Floor)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, still_scene, still(), true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, every_cell_new, still(), false)->Unit(benchmark::kMillisecond);
BENCHMARK(FirstFrame)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Frame, still_scene, still(), true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Frame, moving_tube, moving(), true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Frame, every_cell_new, moving(), false)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tubetrack
