#include "hide.hpp"

#include <cmath>

#include "shape_sums.hpp"

namespace tubetrack {

void hide_from(const std::vector<PredictedPixel>& mine, const TubeModel& model, const Extent& extent,
               const std::vector<PredictedPixel>& pixels, HeightMap& map, std::vector<HiddenCell>& hidden) {
  constexpr float kNearer = 0.5F;  // so near that it hides whatever is there
  auto own = mine.begin();
  for (const PredictedPixel& pixel : pixels) {
    float& depth_m = map.depth_m[pixel.cell];
    if (depth_m <= 0.0F || pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    if (std::abs(depth_m - pixel.depth_m) > agreement_m(model, pixel)) continue;
    while (own != mine.end() && own->cell < pixel.cell) ++own;
    if (own != mine.end() && own->cell == pixel.cell && own->depth_m <= pixel.depth_m) continue;
    hidden.push_back({pixel.cell, depth_m});
    depth_m *= kNearer;
  }
}

void hide_others(std::span<const FollowedTube> tubes, const FollowedTube* self, const std::vector<PredictedPixel>& mine,
                 HeightMap& map, std::vector<HiddenCell>& hidden) {
  for (const FollowedTube& other : tubes) {
    if (&other == self || other.state != TubeState::tracked) continue;
    hide_from(mine, other.model, other.extent, other.pixels, map, hidden);
  }
}

void show_again(HeightMap& map, std::vector<HiddenCell>& hidden) {
  for (auto it = hidden.rbegin(); it != hidden.rend(); ++it) map.depth_m[it->cell] = it->depth_m;
  hidden.clear();
}

}  // namespace tubetrack
