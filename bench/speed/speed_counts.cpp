// What a frame asks of the tracker, counted outside of what is timed.
#include <algorithm>

#include "scene_parts.hpp"
#include "speed_run.hpp"
#include "tubetrack/heightmap/height_map.hpp"

namespace tubetrack::bench {

double pixels_on_tubes(const SpeedScene& speed, const std::vector<RenderedFrame>& frames) {
  constexpr int kStep = 10;
  const auto tubes = static_cast<int>(speed.scene.tubes.size());
  const auto count = static_cast<int>(frames.size());
  double pixels = 0.0;
  int asked = 0;
  for (int k = 0; k < count; k += kStep, ++asked) {
    const ExactImage exact = exact_image(scene_at(speed, k, count), k);
    const auto& depth = frames[static_cast<std::size_t>(k)].depth;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      const bool on_tube = exact.object[i] >= 0 && exact.object[i] < tubes;
      if (on_tube && depth[i] != 0 && exact.incidence_rad[i] < radians(75.0)) pixels += 1.0;
    }
  }
  return pixels / std::max(asked, 1);
}

double cells_that_change(const SpeedScene& speed, const std::vector<RenderedFrame>& frames) {
  const TrackerConfig config = speed_config(speed.scene.camera);
  HeightMap map = make_height_map(speed.scene.camera);
  std::vector<float> before;
  double changed = 0.0;
  for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
    const DepthFrame frame = played_frame(frames, k);
    before = map.inverse_depth_per_m;
    update(map, frame, config.noise, {}, !frame.world_from_camera);
    if (k == 0) continue;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const bool has = map.inverse_depth_per_m[i] > 0.0F;
      const bool had = before[i] > 0.0F;
      changed += (has ? map.count[i] == 1 : had) ? 1.0 : 0.0;
    }
  }
  return changed / std::max(static_cast<double>(frames.size()) - 1.0, 1.0);
}

}  // namespace tubetrack::bench
