// SPDX-License-Identifier: Apache-2.0
#include "apps/media.h"

#ifdef EGOSGM_MEDIA  // the library's name
#include <dlfcn.h>

#include "egosgm/error.h"

namespace egosgm::app {

const Media& media() {
  static const Media* const loaded = [] {
    void* const library = ::dlopen(EGOSGM_MEDIA, RTLD_LAZY);  // from where the program looks for its other libraries
    const void* const found = library ? ::dlsym(library, "egosgm_media") : nullptr;
    if (!found) throw IoError(std::string(::dlerror()) + "; it belongs to the program: install both again");
    return static_cast<const Media*>(found);
  }();
  return *loaded;
}

}  // namespace egosgm::app
#else
namespace egosgm::app {

extern "C" const Media egosgm_media;
const Media& media() { return egosgm_media; }

}  // namespace egosgm::app
#endif
