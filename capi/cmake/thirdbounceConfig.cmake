# find_package(thirdbounce) defines
#   thirdbounce::thirdbounce   the shared library, with headers for C11 and C++17
#   thirdbounce::static        the static library, with what it links
# Paths are relative to this file: the folder may be moved.
get_filename_component(_thirdbounce_root "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET thirdbounce::thirdbounce)
    add_library(thirdbounce::thirdbounce SHARED IMPORTED)
    set_target_properties(thirdbounce::thirdbounce PROPERTIES
        IMPORTED_LOCATION "${_thirdbounce_root}/lib/libthirdbounce.so"
        INTERFACE_INCLUDE_DIRECTORIES "${_thirdbounce_root}/include")
    add_library(thirdbounce::static STATIC IMPORTED)
    set_target_properties(thirdbounce::static PROPERTIES
        IMPORTED_LOCATION "${_thirdbounce_root}/lib/libthirdbounce.a"
        INTERFACE_INCLUDE_DIRECTORIES "${_thirdbounce_root}/include"
        INTERFACE_LINK_LIBRARIES "gcc_s;util;rt;pthread;m;dl")
endif()
unset(_thirdbounce_root)
