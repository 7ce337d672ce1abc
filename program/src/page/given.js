// What the page was given.
const view = JSON.parse(document.getElementById("data").textContent);

