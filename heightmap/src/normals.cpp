#include "tubetrack/heightmap/surfel.hpp"
