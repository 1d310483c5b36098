# The third way of ./run, which reads this file: a private Debian root. It ends in the command.
# The last line is what the wheels of vtk (EGL, software rendering) and gmsh load; FFCx needs the C compiler.
packages=(ca-certificates python3-dolfinx-real python3-petsc4py-real libopenblas0-pthread python3-venv python3-pip gcc openmpi-bin procps
    libegl1 libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1 libfontconfig1 libgomp1)
lacks() { die "${why}a Debian root needs $*"; }
install_host_tools() {
    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}
need_host_tools() {
    local missing=()
    command -v mmdebstrap >/dev/null || missing+=(mmdebstrap)
    [ -e /usr/share/keyrings/debian-archive-keyring.gpg ] || missing+=(debian-archive-keyring)
    [ "$(id -u)" = 0 ] || command -v newuidmap >/dev/null || missing+=(uidmap)
    [ ${#missing[@]} -gt 0 ] || return 0
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || lacks "${missing[*]} (sudo apt-get install ${missing[*]})"
    say "installing ${missing[*]} on this machine"
    built "$cache/host.log" "could not install ${missing[*]}" install_host_tools "${missing[@]}"
}
bootstrap() {
    local build
    # dolfinx's Python package depends on its C++ development packages (compilers, Boost, valgrind: 300 packages), and MPI on AMD's GPU
    # libraries. Nothing here uses them: an empty package stands in for them, and halves the time and the size. (Should apt refuse it one
    # day, it installs the real ones.)
    local before='set -e; export APT_CONFIG="$MMDEBSTRAP_APT_CONFIG"
        printf "path-exclude=/usr/share/%s/*\n" doc info locale man >"$1/etc/dpkg/dpkg.cfg.d/pdvol"
        for name in libdolfinx-dev libdolfinx-real-dev $(apt-cache depends libucx0 | sed -n "s/.*Depends: \(libamdhip64-.*\)/\1/p"); do
            version=$(apt-cache show "$name" 2>/dev/null | sed -n "s/^Version: //p" | head -n 1)
            [ -z "$version" ] || provides="${provides:+$provides, }$name (= $version)"
        done
        mkdir -p "$1/tmp/stand-in/DEBIAN"
        printf "%s\n" "Package: pdvol-stand-in" "Version: 1" "Architecture: all" "Maintainer: pdvol" "Provides: $provides" \
            "Description: stands in for packages that pdvol does not use" >"$1/tmp/stand-in/DEBIAN/control"
        chroot "$1" dpkg-deb --build /tmp/stand-in
        chroot "$1" dpkg --install /tmp/stand-in.deb'
    # What the development packages of PETSc and SLEPc would have linked, for Python to find petsc4py and dolfinx.
    local after='set -e; chroot "$1" sh -ec "for lib in petsc slepc; do
            ln -sfn /usr/lib/\${lib}dir/\$lib[0-9]*/*-real /usr/lib/\$lib
            ln -sfn /usr/lib/*/lib\${lib}_real.so.*.*.* /usr/lib/\$lib/lib/lib\${lib}_real.so
        done; python3 -c \"import dolfinx, petsc4py.PETSc\""'
    build=(mmdebstrap --variant=apt --include="$(IFS=,; printf %s "${packages[*]}")" --essential-hook="$before" --customize-hook="$after"
        --aptopt='Acquire::Check-Valid-Until "false"' --aptopt='Acquire::Retries "3"' --dpkgopt=force-unsafe-io)
    if [ "$(id -u)" = 0 ]; then  # the mounts it makes (/proc, /sys) end with its own namespace, even when it is killed
        "${isolate[@]}" "${build[@]}" --mode=root --format=directory "$suite" "$1"
    else  # through a tar stream the files belong to the user, who can then remove them like any others
        mkdir -p "$1"
        "${build[@]}" --mode=unshare --format=tar "$suite" - | tar -x -C "$1" --no-same-owner --exclude='./dev/*'
    fi
}
build_root() {
    [ ! -d "$root" ] || return 0
    need_host_tools
    local aside="$root.partial"
    rm -rf --one-file-system "$aside"
    room "$cache" 2500
    say "building a private Debian $suite root in $root (once, one to two minutes)"
    built "$cache/build-$suite.log" "the Debian root could not be built" bootstrap "$aside"
    touch "$aside/etc/resolv.conf" "$aside/etc/hosts"
    mv "$aside" "$root"
}

# ---- entering the root: bind the machine's own folders into it, then chroot --------------------------------------------------
isolate=(unshare --mount --propagation private)
[ "$(id -u)" = 0 ] || isolate=(unshare --user --map-root-user --mount --propagation private)
own() { case "$1/" in /bin/* | /boot/* | /etc/* | /lib*/* | /lost+found/* | /sbin/* | /usr/*) ;; *) return 1 ;; esac; }  # the root's, not the machine's
enter() {
    local dir host=()
    for dir in /*; do
        if own "$dir"; then continue
        elif [ -L "$dir" ]; then [ -e "$root$dir" ] || cp -P "$dir" "$root$dir" 2>/dev/null || true
        elif [ -d "$dir" ] && mkdir -p "$root$dir" 2>/dev/null; then host+=("$dir"); fi
    done
    # An ordinary user is root for the mounts only: the second unshare gives the own number back, so that nothing in a shared /tmp
    # (Open MPI's folders, say) is taken for root's.
    exec "${isolate[@]}" /bin/sh -c '
        root=$1 cwd=$2 user=$3 group=$4; shift 4
        mount --bind "$root" "$root" || exit 2
        while [ "$1" != -- ]; do mount --rbind "$1" "$root$1" || exit 2; shift; done
        shift
        for file in /etc/resolv.conf /etc/hosts /etc/passwd /etc/group /etc/ssl/certs/ca-certificates.crt; do
            [ ! -s "$file" ] || [ ! -e "$root$file" ] || mount --bind "$(readlink -f "$file")" "$root$file" || exit 2
        done
        mount -o remount,bind,ro "$root" 2>/dev/null || true
        set -- /bin/sh -c '\''cd "$0" && exec "$@"'\'' "$cwd" "$@"
        [ "$user" = 0 ] || exec unshare --user --map-user="$user" --map-group="$group" --root="$root" "$@"
        exec chroot "$root" "$@"
    ' sh "$root" "$PWD" "$(id -u)" "$(id -g)" "${host[@]}" -- "${clean[@]}" "$@"
}

# ---- the third way -----------------------------------------------------------------------------------------------------------
case "$suite" in trixie | sid | forky) ;; *) die "PDVOL_DEBIAN=$suite is not a suite with dolfinx >= 0.9; choose trixie or sid" ;; esac
[ "$(uname -s)" = Linux ] || lacks "Linux"
PATH="$PATH:/usr/sbin:/sbin"  # an ordinary user's may lack them, and chroot is there
for tool in unshare mount chroot flock; do
    command -v "$tool" >/dev/null || lacks "'$tool' (Debian packages util-linux, mount, coreutils)"
done
for dir in "$here" "$(pwd -P)"; do
    ! own "$dir" || die "the environment has its own $(printf %s "$dir" | cut -d/ -f1-2) and cannot see $dir: use another folder"
done
"${isolate[@]}" true 2>/dev/null || lacks "more rights: this machine does not allow mount namespaces" \
    "('${isolate[*]} true' fails). In a container, start it with --cap-add SYS_ADMIN --security-opt apparmor=unconfined; on Ubuntu, an" \
    "ordinary user needs sudo sysctl kernel.apparmor_restrict_unprivileged_userns=0"
mkdir -p "$cache" 2>/dev/null || die "cannot write the cache folder $cache (set PDVOL_CACHE to another folder)"
cache=$(cd "$cache" && pwd -P)
root_of() { printf %s "$cache/$suite-$({ printf '%s\n' "$suite" "${packages[@]}"; declare -f bootstrap; } | sha256sum | cut -c1-12)"; }
case "$suite" in trixie) oversubscribe 5 ;; *) oversubscribe 6 ;; esac
# The machine's Python, compiler and PETSc settings are not the root's; nor are its languages.
clean=(env -u PYTHONHOME -u PYTHONPATH -u VIRTUAL_ENV -u LD_LIBRARY_PATH -u LD_PRELOAD -u PIP_FIND_LINKS -u PETSC_DIR -u PETSC_ARCH -u SLEPC_DIR
    -u CC -u CFLAGS -u LDFLAGS PYTHONNOUSERSITE=1 LC_ALL=C.UTF-8 "${mpi[@]}" OMPI_MCA_btl="${OMPI_MCA_btl:-self,sm}" PATH=/usr/bin:/bin
    OMPI_MCA_mpi_yield_when_idle="${OMPI_MCA_mpi_yield_when_idle:-1}")  # ranks that wait for each other share the cores
[ -n "${DISPLAY:-}" ] || clean+=(VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow)  # or VTK complains that there is no display
root=$(root_of) plain=$root
if [ "${PDVOL_BROWSER:-}" = 1 ]; then  # a root beside the plain one; what cannot be installed is tried again after a day
    packages+=(chromium-headless-shell)
    root=$(root_of)
    [ -d "$root" ] || [ -n "$(find "$root.failed" -mmin -1440 2>/dev/null)" ] || with_lock "$root.lock" build_root ||
        { say "no browser could be installed: tests that need one will be skipped"; touch "$root.failed"; }
    [ -d "$root" ] || root=$plain
fi
[ -d "$root" ] || with_lock "$root.lock" build_root
venv="$here/.venv-$suite"
stamp=$(hash "$plain" "$(readlink "$root/usr/bin/python3")")  # one environment for both roots, as long as their Python is the same
ready || with_lock "$here/.venv.lock" build_venv all python3 --system-site-packages
enter "$inside" PATH="$venv/bin:/usr/bin:/bin" "${command[@]}"
