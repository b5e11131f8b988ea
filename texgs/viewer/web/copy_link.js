// A button that copies the link of what is shown.

/** @param {ScenePage} page - with link and notices */
export function copyLinkBy(button, page) {
  button.hidden = location.protocol === "about:"; // within another page it has no address of its own
  button.onclick = async () => {
    try {
      await navigator.clipboard.writeText(page.link); // missing where the page came without encryption
      page.notices.tell("Copied a link to this view, with its bookmarks, colours, light, cuts and functions.", "info");
    } catch {
      page.notices.tell("This browser does not let the page copy: take the link from the address bar.", "error");
    }
  };
}
