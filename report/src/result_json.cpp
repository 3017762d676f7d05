#include "tubetrack/tracker/tube.hpp"
