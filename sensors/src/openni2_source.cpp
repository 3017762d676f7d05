#include <OpenNI.h>
