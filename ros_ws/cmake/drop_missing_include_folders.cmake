# For ROS 2 wheels only (see the Makefile); a system ROS 2 does not need it.
#
# Some exported targets in the wheels name include folders of the machine that built them. CMake
# stops at a folder that does not exist, so drop those that neither exist nor are generator
# expressions, once every package of the directory has been found.

function(_drs_drop_missing_include_folders)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT folders)
      continue()
    endif()
    set(kept "")
    foreach(folder IN LISTS folders)
      if(folder MATCHES "\\$<" OR EXISTS "${folder}")
        list(APPEND kept "${folder}")
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${kept}")
  endforeach()
endfunction()

cmake_language(DEFER CALL _drs_drop_missing_include_folders)
