#pragma once

#include <string>

namespace tubetrack::bench {

/// Normals of a torus of 60/12 mm, digitised with steps of 3 mm and finer, by each estimator, as voxels and as a height
/// map: mean and largest error, and the processor time a thousand surfels take.
std::string normal_table_text();

}  // namespace tubetrack::bench
