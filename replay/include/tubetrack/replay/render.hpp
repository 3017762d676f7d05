#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "tubetrack/replay/depth_noise.hpp"
#include "tubetrack/replay/synthetic_scene.hpp"
#include "tubetrack/replay/tube_truth.hpp"
#include "tubetrack/sensors/depth_frame.hpp"

namespace tubetrack {

/// One frame of a scene as the sensor would give it, and what is true in it.
struct RenderedFrame {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> depth;  ///< row-major, 0 is "no return"
  double metres_per_unit = 0.001;
  double timestamp_s = 0.0;
  std::optional<Eigen::Isometry3d> world_from_camera;  ///< set when the scene has a camera path
  TruthFrame truth;                                    ///< in the world frame then, otherwise in the camera's
};

/// Casts a ray through every pixel and adds the noise. Same scene (with its seed), frame and noise: same bytes.
/// The scene must pass `validate`; frames past `scene.frames` are fine.
RenderedFrame render_frame(const Scene& scene, int frame, const DepthNoise& noise);

/// What the ray through each pixel's centre meets, without noise; row-major.
struct ExactImage {
  std::vector<double> depth_m;        ///< z in the camera frame; infinite where the ray meets nothing
  std::vector<double> incidence_rad;  ///< between the ray and the surface's normal, 0 to π/2
  std::vector<int> object;            ///< place in Scene::tubes, or tubes.size() + place in Scene::solids; −1: nothing
};
ExactImage exact_image(const Scene& scene, int frame);

/// A view of a rendered frame, which must outlive it; `index` is the frame's number.
DepthFrame depth_frame(const RenderedFrame& rendered);

/// Renders all frames into a TUM-form recording with truth.jsonl (DESIGN §4). `path` is a new or
/// empty folder, or an earlier recording of ours, which is overwritten.
Expected<void> write_synthetic_recording(const Scene& scene, const DepthNoise& noise,
                                         const std::filesystem::path& path);

}  // namespace tubetrack
