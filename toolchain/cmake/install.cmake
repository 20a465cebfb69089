# What is installed where, and the Debian packages (toolchain/package): boothd, boothd-models, boothd-dev, boothd-dbg.
include(GNUInstallDirs)

install(TARGETS boothd boothctl RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT boothd)
install(TARGETS boothd-usb-recover RUNTIME DESTINATION lib/boothd COMPONENT boothd)
install(DIRECTORY fit/models/ DESTINATION ${CMAKE_INSTALL_DATADIR}/boothd/models COMPONENT models FILES_MATCHING PATTERN "*.npz" PATTERN "*.csv")
install(DIRECTORY daemon/dds/idl/ DESTINATION ${CMAKE_INSTALL_DATADIR}/boothd/idl COMPONENT dev FILES_MATCHING PATTERN "*.idl")
install(FILES toolchain/packaging/boothdConfig.cmake DESTINATION ${CMAKE_INSTALL_DATADIR}/cmake/boothd COMPONENT dev)

# systemd's folders are below /usr/lib of the host whatever the architecture; Debian 12's debhelper puts them below /lib, which is a link to it.
file(GLOB units CONFIGURE_DEPENDS systemd/*.service systemd/*.path systemd/*.slice)
file(GLOB udev_rules CONFIGURE_DEPENDS systemd/*.rules)
# What one box needs and another does not is for the administrator to put in place: a graphics processor, a real-time schedule, credentials.
install(DIRECTORY systemd/boothd.service.d DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/boothd/examples COMPONENT boothd OPTIONAL)
# So are the ways of updating: they belong to the site's own scheme (docs/guide/operate.md).
install(DIRECTORY toolchain/packaging/update DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/boothd/examples COMPONENT boothd USE_SOURCE_PERMISSIONS)
install(FILES ${units} DESTINATION /lib/systemd/system COMPONENT boothd)
install(FILES ${udev_rules} DESTINATION /lib/udev/rules.d COMPONENT boothd)
install(FILES systemd/boothd.sysusers DESTINATION /usr/lib/sysusers.d RENAME boothd.conf COMPONENT boothd)
install(FILES systemd/boothd.tmpfiles DESTINATION /usr/lib/tmpfiles.d RENAME boothd.conf COMPONENT boothd)
install(FILES toolchain/packaging/boothd.toml DESTINATION /etc/boothd COMPONENT boothd)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/boothd COMPONENT boothd FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.svg")

# Made by toolchain/package, which knows the programs' own help and the commit's date: manual pages, changelogs, licences, the bill of materials.
set(BOOTHD_PACKAGE_FILES "" CACHE PATH "Folder with files that packages add, one folder for each component")
if(BOOTHD_PACKAGE_FILES)
  foreach(component boothd models dev dbg)
    install(DIRECTORY ${BOOTHD_PACKAGE_FILES}/${component}/ DESTINATION / COMPONENT ${component} OPTIONAL)
  endforeach()
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "the boothd developers")
set(CPACK_PACKAGE_CONTACT "boothd developers <boothd@boothd.dev>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL boothd models dev dbg)
# Debug symbols are a package of their own, made from the programs as built; what is installed is stripped.
set(CPACK_STRIP_FILES ON)
# CPack puts a summary of its own before each description unless it is the one that it thinks nobody has set.
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_NAME} built using CMake")
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

set(CPACK_DEBIAN_BOOTHD_PACKAGE_NAME boothd)
set(CPACK_DEBIAN_BOOTHD_DESCRIPTION "capture booth: body model and live skeleton from depth cameras
The daemon inside an installed capture booth, and the command by which people
talk to it. Four depth cameras see a person; boothd finds that person's own
body model and publishes the skeleton live over DDS.")
set(CPACK_DEBIAN_BOOTHD_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_BOOTHD_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_BOOTHD_PACKAGE_DEPENDS "boothd-models (= ${PROJECT_VERSION}-1), init-system-helpers (>= 1.51), adduser")
set(CPACK_DEBIAN_BOOTHD_PACKAGE_RECOMMENDS "systemd (>= 252), udev")
set(scripts ${PROJECT_SOURCE_DIR}/toolchain/packaging)
set(CPACK_DEBIAN_BOOTHD_PACKAGE_CONTROL_EXTRA "${scripts}/postinst;${scripts}/prerm;${scripts}/postrm;${scripts}/conffiles")

set(CPACK_DEBIAN_MODELS_PACKAGE_NAME boothd-models)
set(CPACK_DEBIAN_MODELS_DESCRIPTION "body models and pose prior for boothd
Body shapes of men and women, and what human poses look like, as statistics
trained from public data; the bodies that were set aside for measuring errors.")
set(CPACK_DEBIAN_MODELS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_MODELS_PACKAGE_ARCHITECTURE all)

set(CPACK_DEBIAN_DEV_PACKAGE_NAME boothd-dev)
set(CPACK_DEBIAN_DEV_DESCRIPTION "DDS types of boothd, for programs that subscribe to it
The IDL of the topics and a CMake package that compiles it.")
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION devel)
set(CPACK_DEBIAN_DEV_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "cyclonedds-dev, cyclonedds-tools")

set(CPACK_DEBIAN_DBG_PACKAGE_NAME boothd-dbg)
set(CPACK_DEBIAN_DBG_DESCRIPTION "debug symbols of boothd
What gdb and a backtrace need to name functions and lines of boothd, boothctl
and boothd-usb-recover; found by the build's own identity.")
set(CPACK_DEBIAN_DBG_PACKAGE_SECTION debug)
set(CPACK_DEBIAN_DBG_PACKAGE_DEPENDS "boothd (= ${PROJECT_VERSION}-1)")

include(CPack)
