#include "analysis/allan/allan.hpp"
